"""Full trials in batches, against the motion of the same cars alone, in one run.

Motion alone is the call that moves batches, contacts and all, given commands: first speeds and yaw rates that stay,
each car its own, as in the table of `benchmarks.overview`; then, for comparison, the commands of these very trials,
played back. There cars wait and keep apart, so that no two of them come so near that contacts are looked for.

A trial: 60 s, 6 `lawful` e-agents, the `rules` ego, a grid of 4 x 5 intersections, all rules judged, scores, no
records.
Times are of this process's processor time. Only two threads are measured by the clock: all trials four times over, in
groups of half the size, on one thread and on two in turn, and the best round of each counts, since whatever else the
machine does falls on one of them only.
"""

from __future__ import annotations

from time import perf_counter, process_time
from typing import Any

import numpy as np

from benchmarks.table import Row
from dubins_traffic.engine.batch import outcomes
from dubins_traffic.engine.group import Group
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.configuration import Configuration, load_config
from dubins_traffic.problem.draw import draw_many
from dubins_traffic.problem.instance import Instance
from dubins_traffic.simulators.embedded import Embedded

TRIALS, DURATION, ROUNDS = 128, 60, 7
BATCH = 64
CLOCK_ROUNDS = 7


def configuration(agents: int = 6, duration: int = DURATION) -> dict[str, Any]:
    """Return the configuration of the trials."""
    return {
        "version": 1,
        "problem_domain": "dubins_traffic",
        "network": {"grid": {"rows": 4, "columns": 5, "length": 4.0}},
        "rules": {},
        "e-agents": [{"type": "lawful", "name": "agent", "count": agents}],
        "number_trials": TRIALS,
        "duration": duration,
        "number_goals_bounds": [2, 2],
    }


def measure() -> list[Row]:
    """Return the rows of this benchmark; the best of some rounds counts."""
    config = load_config(configuration())
    instances, drawing = _drawn(config)
    own = load_config({**configuration(), "network": {"random": {"intersections": 12, "segments": 16}}})
    drawn = [_drawn(own) for _ in range(ROUNDS)]
    own_drawing = min(seconds for _, seconds in drawn)
    list(outcomes(instances[:2]))
    steps = TRIALS * len(instances[0].starts) * instances[0].ticks
    played = _commands(instances)
    staying = [circling(played[0].shape[:2])] * len(played)
    motion, back = _motion(instances, staying), _motion(instances, played)
    kernel = min(_kernel(instances) for _ in range(ROUNDS))
    whole = min(_whole(instances) for _ in range(ROUNDS))
    apart = min(_whole(others) for others, _ in drawn)
    rounds = [(_clock(instances, 1), _clock(instances, 2)) for _ in range(CLOCK_ROUNDS)]
    one, two = (min(seconds[k] for seconds in rounds) for k in (0, 1))
    return [
        Row("motion alone, commands that stay", f"{steps / motion:.2e} car-steps/s", "", True),
        Row("motion alone, the trials' commands played back", f"{steps / back:.2e} car-steps/s", "", True),
        Row(
            "drivers, motion, labels, referee, metrics: the compiled pass",
            f"{steps / kernel:.2e} car-steps/s = {motion / kernel:.2f} of motion,"
            f" {back / kernel:.2f} of it played back",
            "",
            True,
        ),
        Row(
            "with tables, rounds, scores and verdicts of each trial",
            f"{steps / whole:.2e} car-steps/s = {TRIALS / whole:.0f} trials/s, {motion / whole:.2f} of motion,"
            f" {back / whole:.2f} of it played back",
            ">= 8e6 car-steps/s, >= 600 trials/s, >= 1/6 of motion",
            steps / whole >= 8e6 and TRIALS / whole >= 600 and motion / whole >= 1.0 / 6.0,
        ),
        Row(
            "the same, each trial on a random network of its own",
            f"{TRIALS / apart:.0f} trials/s = {whole / apart:.2f} of those on one",
            ">= 0.7 of those on one",
            whole / apart >= 0.7,
        ),
        Row(
            "drawing an instance; one with a random network of its own",
            f"{1e3 * drawing / TRIALS:.2f} ms; {1e3 * own_drawing / TRIALS:.1f} ms",
            "",
            True,
        ),
        Row("two threads, by the clock", f"{one / two:.2f} times one", ">= 1.7", one / two >= 1.7),
    ]


def _drawn(config: Configuration) -> tuple[list[Instance], float]:
    """Return the instances, and the seconds that drawing them takes."""
    list(draw_many(config, 1, range(2)))
    began = process_time()
    instances = list(draw_many(config, 1, range(TRIALS)))
    return instances, process_time() - began


def _commands(instances: list[Instance]) -> list[Floats]:
    """Return the commands of all cars in each tick of a run; a group may have more places than cars."""
    group = Group(instances, keeps_rules=True)
    played: list[Floats] = []
    while len(group.active):
        group.advance()
        played.append(group.commands[:, : len(instances[0].starts)].copy())
    return played


def circling(shape: tuple[int, ...]) -> Floats:
    """Return commands that stay for so many trials and cars: 0.4 m/s, and yaw rates between -1 and 1 rad/s."""
    commands = np.zeros((*shape, 2))
    commands[..., 0] = 0.4
    commands[..., 1] = np.random.default_rng(1).uniform(-1.0, 1.0, shape)
    return commands


def _motion(instances: list[Instance], played: list[Floats]) -> float:
    """Return the seconds in which the cars move, without those in which their commands are copied to one array.

    So their commands are in the nearest memory, as those of the pass are.
    """
    commands = np.zeros_like(played[0])
    copying: list[float] = []
    both: list[float] = []
    for _ in range(ROUNDS):
        simulator = Embedded()
        simulator.reset(instances)
        began = process_time()
        for own in played:
            commands[:] = own
        copied = process_time()
        for own in played:
            commands[:] = own
            simulator.step(commands)
        copying.append(copied - began)
        both.append(process_time() - copied)
    return min(both) - min(copying)


def _kernel(instances: list[Instance]) -> float:
    spent = 0.0
    for first in range(0, TRIALS, BATCH):
        group = Group(instances[first : first + BATCH], keeps_rules=True)
        began = process_time()
        group.finish()
        spent += process_time() - began
    return spent


def _whole(instances: list[Instance]) -> float:
    began = process_time()
    list(outcomes(instances, batch=BATCH))
    return process_time() - began


def _clock(instances: list[Instance], threads: int) -> float:
    began = perf_counter()
    list(outcomes(4 * instances, batch=BATCH // 2, threads=threads))
    return perf_counter() - began
