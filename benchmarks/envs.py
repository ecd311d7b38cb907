"""Environments for learning, against whole compiled trials, `act_batch` and highway-env, in one run.

64 environments of 8 cars: seven `lawful` e-agents and the ego on a grid of 4 x 5 intersections, all rules judged, 20 s.
They are stepped every tick (`frame_skip` 1) with the commands that the controller `rules` gives in these very trials,
so that the same work is done with and without Python; each step gives observation, terms of the reward, costs and
infos. Times are of this process's processor time, by turns; the best round of each counts.

What a controller's `act_batch` does is up to it. It is measured bare, handing out commands that are there already, and
with observation and reward worked out in NumPy, as far as it is told enough: the way to the goal is as the crow flies,
and of the rules only those are charged whose breach shows in the propositions. Five times the bare rate would be more
than that of whole compiled trials, so the bar is on the other. That of commit 56b95fc is measured in a process of its
own on that commit's tree: in the folder that the
environment variable OLD_TREE names, else in build/old, where git puts it first.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
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
from dubins_traffic.envs.episodes import Episodes
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.instance import Instance

ENVS, AGENTS, DURATION, ROUNDS, SKIP = 64, 7, 20, 7, 4
OLD = "56b95fc"
ROOT = Path(__file__).parents[1]
HIGHWAY = peers.Peer("highway-env", "highway", "drivers, observed every tick")
PATIENCE = 560.0


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
    tree = _old_tree()
    bare, learning = (_act_batch(document, commands, tree, does) for does in ("bare", "learning"))
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
        Row("a reset, of all environments at once", f"{1e3 * reset:.3f} ms", "<= 0.2 ms", reset <= 2e-4),
        _against(f"act_batch of {OLD}, bare", ticks / every, bare, 0.0),
        _against(f"act_batch of {OLD}, with observation and reward", ticks / every, learning, 5.0),
        _against(highway.what, cars * ticks / every, highway.per_second, 2000.0, "car-steps/s"),
    ]


def _against(what: str, ours: float, rate: float | None, least: float, unit: str = "steps/s") -> Row:
    """Return the row that compares us with another rate; without a bar where `least` is 0."""
    bar = f"environments >= {least:g} times" if least else ""
    if rate is None:
        return Row(what, "not measured", bar, not least)
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


def _round(
    document: dict[str, Any], instances: list[Instance], actions: Floats
) -> tuple[float, float, float]:
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


def _old_tree() -> Path | None:
    """Return the folder that holds the earlier commit; None if it can't be had."""
    named = os.environ.get("OLD_TREE")
    if named:
        return Path(named)
    folder = ROOT / "build" / "old" / OLD
    if not folder.is_dir():
        command = ["git", "-C", str(ROOT), "worktree", "add", "--detach", str(folder), OLD]
        if subprocess.run(command, capture_output=True, check=False).returncode:
            return None
    return folder


def _act_batch(document: dict[str, Any], commands: Floats, tree: Path | None, does: str) -> float | None:
    """Return the steps a second of `act_batch` of a tree, None if it could not be measured."""
    if tree is None:
        return None
    with tempfile.TemporaryDirectory() as name:
        config, played = Path(name, "config.json"), Path(name, "commands.npy")
        config.write_text(json.dumps(document), encoding="utf-8")
        np.save(played, commands)
        script = [
            sys.executable,
            str(ROOT / "benchmarks" / "act_batch_peer.py"),
            str(config),
            str(played),
            does,
        ]
        named = os.environ.get("OLD_CACHE") if tree != ROOT else None
        cache = {"NUMBA_CACHE_DIR": named} if named else {}
        own = os.environ | {"PYTHONPATH": str(tree / "src"), "DUBINS_TRAFFIC_KERNELS": "compiled"} | cache
        ran = subprocess.run(script, capture_output=True, text=True, env=own, timeout=PATIENCE, check=False)
    if ran.returncode:
        print(peers.last_line(ran.stderr), file=sys.stderr)
        return None
    found = json.loads(peers.last_line(ran.stdout))
    return found["steps"] / found["seconds"]
