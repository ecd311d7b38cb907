"""Environments for learning, against whole compiled trials and highway-env, in one run; several learners against one.

64 environments of 8 cars: seven `lawful` e-agents and the ego on a grid of 4 x 5 intersections, all rules judged, 20 s.
They are stepped every tick (`frame_skip` 1) with the commands that the controller `rules` gives in these very trials,
so that the same work is done with and without Python; each step gives observation, terms of the reward, costs and
infos. Times are of this process's processor time, by turns; the best round of each counts.
"""

from __future__ import annotations

from time import process_time
from typing import Any

import gymnasium
import numpy as np

import dubins_traffic.envs  # noqa: F401  # makes its environments known
from benchmarks import peers
from benchmarks.batch import configuration
from benchmarks.table import Row
from dubins_traffic.engine.batch import outcomes
from dubins_traffic.engine.group import Group
from dubins_traffic.envs.crew import agent_name
from dubins_traffic.envs.episodes import Episodes
from dubins_traffic.envs.parallel_vector import TrafficParallelVectorEnv
from dubins_traffic.envs.vector import TrafficVectorEnv
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.instance import Instance

ENVS, AGENTS, DURATION, ROUNDS, SKIP, STEPS = 64, 7, 20, 7, 4, 300
TOWNS, TOWN_STEPS = 512, 1800
"""Environments, and steps of a fifth of a second, in which each of them begins two episodes or three."""
HIGHWAY = peers.Peer("highway-env", "highway", "drivers, observed every tick")


def measure() -> list[Row]:
    """Return the rows of this benchmark."""
    document = configuration(AGENTS, DURATION)
    instances = Episodes(load_config(document)).draw([(1, env, 0) for env in range(ENVS)])
    commands = _commands(instances)
    actions = _actions(commands, instances[0])
    _stepped(document, actions, 1)
    list(outcomes(instances, batch=ENVS))
    ticks = ENVS * len(commands)
    rounds = [_round(document, instances, actions) for _ in range(ROUNDS)]
    whole, every, skipping = (min(seconds) for seconds in zip(*rounds, strict=True))
    reset = min(_resetting(document) for _ in range(ROUNDS))
    cars = AGENTS + 1
    highway = peers.rate(HIGHWAY, cars)
    return [
        Row("whole compiled trials", f"{ticks / whole:.2e} trial-steps/s", "", True),
        Row(
            f"{ENVS} environments of {cars} cars, a step a tick",
            f"{ticks / every:.2e} steps/s = {whole / every:.2f} of whole trials",
            ">= 0.4 of whole trials",
            whole / every >= 0.4,
        ),
        Row(
            f"the same, {SKIP} ticks a step",
            f"{ticks / skipping:.2e} ticks/s = {whole / skipping:.2f} of whole trials",
            "",
            True,
        ),
        *_several(document),
        *_towns(),
        Row("a reset, of all environments at once", f"{1e3 * reset:.3f} ms", "<= 0.2 ms", reset <= 2e-4),
        _against(highway.what, cars * ticks / every, highway.per_second, 2000.0, "car-steps/s"),
    ]


def _several(document: dict[str, Any]) -> list[Row]:
    """Return the rows that compare the steps of learners that drive all cars with those of one, and under shields."""
    all_cars: Any = {agent_name(car): "sure" for car in range(AGENTS + 1)}
    shape, rates = (ENVS, AGENTS + 1, 2), list[list[float]]([[], [], []])
    makers = (
        (lambda: TrafficVectorEnv(ENVS, document), (ENVS, 2)),
        (lambda: TrafficParallelVectorEnv(ENVS, document), shape),
        (lambda: TrafficParallelVectorEnv(ENVS, document, shields=all_cars), shape),
    )
    for _ in range(ROUNDS):
        for found, (make, size) in zip(rates, makers, strict=True):
            env, actions = make(), np.random.default_rng(1).uniform(0.0, 1.0, size)
            env.reset(seed=1)
            env.step(actions)
            began = process_time()
            for _ in range(STEPS):
                env.step(actions)
            found.append(float(np.prod(size[:-1])) * STEPS / (process_time() - began))
    one, every, shielded = map(max, rates)
    return [
        Row(
            f"{AGENTS + 1} learners in each, steps of all of them",
            f"{every:.2e} steps/s = {every / one:.2f} of those of one",
            ">= 0.4 of those of one",
            every / one >= 0.4,
        ),
        Row(
            "the same, each under a shield",
            f"{shielded:.2e} steps/s = {shielded / every:.2f} of those without",
            "",
            True,
        ),
    ]


def _towns() -> list[Row]:
    """Return the rows that compare environments that draw a network for each episode with those that have 200."""
    drawn, kept = (min((_steps_of_towns(own) for _ in range(2)), key=sum) for own in (None, 200))
    longest, slower = max(drawn) / float(np.median(drawn)), sum(drawn) / sum(kept)
    return [
        Row(
            f"{TOWNS} environments of `town`, a road network each episode",
            f"{TOWNS * TOWN_STEPS / sum(drawn):.2e} steps/s; {slower:.2f} of the time with 200 networks",
            "<= 1.3 of that",
            slower <= 1.3,
        ),
        Row("the same: the longest step", f"{longest:.0f} times the median", "<= 20", longest <= 20.0),
    ]


def _steps_of_towns(levels: int | None) -> list[float]:
    """Return the seconds of each step of some environments of `town`, of which no others are there."""
    env = TrafficVectorEnv(TOWNS, "town", frame_skip=6, staggered=True, levels=levels)
    actions = np.random.default_rng(1).uniform(-1.0, 1.0, (8, TOWNS, 2))
    env.reset(seed=1)
    seconds: list[float] = []
    for k in range(TOWN_STEPS):
        began = process_time()
        env.step(actions[k % 8])
        seconds.append(process_time() - began)
    return seconds


def _against(what: str, ours: float, rate: float | None, least: float, unit: str = "steps/s") -> Row:
    """Return the row that compares us with another rate; without a bar where `least` is 0."""
    bar = f"environments >= {least:g} times" if least else ""
    if rate is None:
        return Row(what, "not measured: it is not installed", "", True)
    return Row(what, f"{rate:.2e} {unit}; environments {ours / rate:.1f} times", bar, ours / rate >= least)


def _commands(instances: list[Instance]) -> Floats:
    """Return the commands of the egos, kept by the rules, in each tick: (ticks, trials, 2)."""
    group = Group(instances, keeps_rules=True)
    played: list[Floats] = []
    while len(group.active):
        group.advance()
        played.append(group.commands[:, 0].copy())
    return np.array(played)


def _actions(commands: Floats, instance: Instance) -> Floats:
    bounds = instance.problem.car.bounds
    return commands / np.array([bounds.speed, bounds.yaw_rate])


def _round(document: dict[str, Any], instances: list[Instance], actions: Floats) -> tuple[float, float, float]:
    """Return the seconds of whole trials, of a step every tick, and of one every few ticks."""
    began = process_time()
    list(outcomes(instances, batch=ENVS))
    whole = process_time() - began
    return whole, _stepped(document, actions, 1), _stepped(document, actions[::SKIP], SKIP)


def _made(document: dict[str, Any], skip: int = 1) -> Any:
    return gymnasium.make_vec(
        "dubins_traffic/Traffic-v0",
        num_envs=ENVS,
        vectorization_mode="vector_entry_point",
        config=document,
        frame_skip=skip,
        autoreset_mode="Disabled",
    )


def _stepped(document: dict[str, Any], actions: Floats, skip: int) -> float:
    env = _made(document, skip)
    began = process_time()
    env.reset(seed=1)
    for action in actions:
        ended = env.step(action)[3]
    spent = process_time() - began
    if not ended.all():
        raise RuntimeError("trials were not run to their ends")
    return spent


def _resetting(document: dict[str, Any], times: int = 8) -> float:
    """Return the seconds that a reset of one environment takes, where all are reset together."""
    env = _made(document)
    env.reset(seed=2)
    began = process_time()
    for _ in range(times):
        env.reset()
    return (process_time() - began) / (times * ENVS)
