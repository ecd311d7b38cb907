"""`python -m experiments.competition [COUNT]`: entries judged at home and as a server does, frames compared.

At home trials run one after the other in this process; a server's two workers take them in chunks, in another order.
Entries drive in boxes: two in Python, one that keeps the rules, one program of its own in C++.
"""

from __future__ import annotations

import gzip
import random
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from benchmarks.table import Row, show

from dubins_traffic.competition.competition import Competition, Phase
from dubins_traffic.competition.judging import FramesHash, Judged, judge
from dubins_traffic.competition.submission import Submission, check_submission
from dubins_traffic.competition.templates import write_template
from dubins_traffic.protocols import End
from dubins_traffic.runs.single import run_trial
from dubins_traffic.runs.sources import load_record
from dubins_traffic.sandbox import boxed_controller

COUNT = 1000
CHUNK = 10
AN_HOUR = 40
"""Submissions of 100 trials of `demo` that two quiet cores should judge in an hour."""
CORES = 2
SAMPLE = 5
"""Trials of 100 that are run a second time."""
MEASURED = 10
"""Trials of `demo` whose processor time is measured."""
RULES = b"from dubins_traffic.controllers.rules import Rules as Controller\n"
SWERVES = b"""
class Controller:
    def start(self, problem):
        self.goals = len(problem.goals)

    def act(self, seen):
        near = sum(car.pose.x - seen.pose.x for car in seen.others)
        return 0.4, (0.3 * seen.pose.s + 0.01 * near) * self.goals
"""
WORLD = {"version": 1, "problem_domain": "dubins_traffic", "duration": 12, "number_goals_bounds": [1, 3]}
ROADS: dict[str, dict[str, Any]] = {
    "grid": {
        **WORLD,
        "network": {"grid": {"rows": 2, "columns": 3, "length": 3.0}},
        "e-agents": [{"type": "lawful", "name": "car", "count": 3}],
        "rules": True,
    },
    "town": {
        **WORLD,
        "network": {"random": {"intersections": 12, "segments": 15, "rigid_motion": True}},
        "e-agents": [{"type": "lawful", "name": "car", "count": 2}],
        "disturbances": {"position_noise": 0.02},
        "rules": True,
    },
    "free": {
        **WORLD,
        "network": {"grid": {"rows": 3, "columns": 4, "length": 3.0}},
        "e-agents": [{"type": "wander", "name": "agent", "count": 2}],
        "laser": True,
    },
}


@dataclass(frozen=True, slots=True)
class Part:
    """A chunk of trials of a submission, with their seeds."""

    phase: Phase
    submission: Submission
    seeds: dict[int, int]


def phase_of(roads: dict[str, Any], trials: int) -> Phase:
    """Return a phase of some trials, about evenly spread over configurations."""
    document = {
        "version": 0,
        "title": "benchmark",
        "configurations": [{"name": name, "document": own} for name, own in roads.items()],
        "phases": {"practice": {"seed": 16, "trials": max(1, -(-trials // len(roads))), "shows": "all"}},
    }
    return Competition.from_document(document).phase("practice")


def entries(folder: Path) -> list[Submission]:
    """Return what drives."""
    for kind in ("python", "cpp"):
        write_template(kind, folder / kind)
    subprocess.run(["make", "-s"], cwd=folder / "cpp", check=True)
    sources: list[Path | bytes] = [folder / "python", folder / "cpp", RULES, SWERVES]
    return [check_submission(source, folder / "store") for source in sources]


def judged(part: Part) -> list[Judged]:
    """Judge a chunk, as a worker does."""
    return list(judge(part.phase, part.seeds, part.submission, seeds=part.seeds))


def at_a_server(parts: list[Part], workers: int) -> list[list[Judged]]:
    """Judge chunks by several processes."""
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        return list(pool.map(judged, parts))


def compared(count: int, folder: Path) -> tuple[int, int, list[str]]:
    """Return how many trials there were, how many had equal frames, and what differed."""
    found = entries(folder)
    phase = phase_of(ROADS, -(-count // len(found)))
    order = list(phase.numbers)[: -(-count // len(found))]
    seeds = phase.seeds()
    home = {(own.digest, one.number): one for own in found for one in judge(phase, order, own) if one.counts}
    random.Random(count).shuffle(order)
    chunks = [order[first : first + CHUNK] for first in range(0, len(order), CHUNK)]
    parts = [Part(phase, own, {number: seeds[number] for number in chunk}) for own in found for chunk in chunks]
    random.Random(2 * count).shuffle(parts)
    equal, differ = 0, list[str]()
    for part, results in zip(parts, at_a_server(parts, 2), strict=True):
        for one in results:
            other = home.get((part.submission.digest, one.number))
            same = other is not None and one.frames == other.frames and one.row == other.row
            equal += same
            differ += [] if same else [f"{part.submission.digest[:12]} trial {one.number}: {one.end}"]
    return len(found) * len(order), equal, differ


def demo(count: int, folder: Path) -> tuple[Phase, Submission]:
    """Return a phase of `demo`, and who drives there."""
    from dubins_traffic.problem.configuration import load_config

    return phase_of({"demo": load_config("demo").to_document()}, count), entries(folder)[-1]


def an_hour(count: int, folder: Path) -> float:
    """Return how many submissions of 100 trials of `demo` two workers judge in an hour."""
    phase, own = demo(count, folder)
    parts = [Part(phase, own, {number: 16}) for number in phase.numbers]
    at_a_server(parts[:2], 2)
    began = time.perf_counter()
    at_a_server(parts, 2)
    return 3600.0 / (time.perf_counter() - began) * len(parts) / 100


def processor_s(folder: Path, count: int = MEASURED) -> tuple[float, float]:
    """Return the processor time of a submission of 100 trials of `demo`, seconds: that of the judge, and of its boxes.

    The judge records each trial, packs its replay, and runs a sample twice. How busy the machine is hardly counts.
    """
    from dubins_traffic.service.worker import replay_of

    phase, own = demo(count + 1, folder)
    record, boxes, began = folder / "trial.mcap", 0.0, 0.0
    for number in phase.numbers:
        instance = phase.instance(number, 16)
        seat = boxed_controller(str(own.path), phase.limits(instance))
        result = run_trial(instance, seat, record=record, overwrite=True, sinks=(FramesHash(),), sketch=False)
        assert result.ending.end is not End.CONTROLLER_FAULT, result.ending
        gzip.compress(replay_of(load_record(record)).encode(), 6)
        if number == 0:
            began = time.process_time()
        else:
            boxes += seat.seconds
    each = (100 + SAMPLE) / count
    return (time.process_time() - began) * each, boxes * each


def measure(count: int = COUNT) -> list[Row]:
    """Judge `count` trials twice, and some of `demo` against the clock."""
    with tempfile.TemporaryDirectory() as folder:
        total, equal, differ = compared(count, Path(folder) / "frames")
        rate = an_hour(max(4, count // 20), Path(folder) / "hour")
        judge_s, boxes_s = processor_s(Path(folder) / "processor")
    most = CORES * 3600 / AN_HOUR
    for line in differ:
        print(line, file=sys.stderr)
    return [
        Row(f"trials with equal frames of {total}", str(equal), "all", equal == total >= count),
        Row(
            "processor time of a submission of 100 trials of demo",
            f"{judge_s + boxes_s:.0f} s: judge {judge_s:.0f} s, boxes {boxes_s:.0f} s",
            f"<= {most:.0f} s: {AN_HOUR} an hour on {CORES} cores",
            judge_s + boxes_s <= most,
        ),
        Row(
            "submissions of 100 trials of demo an hour, as busy as this machine is",
            f"{rate:.0f}",
            f">= {AN_HOUR}",
            rate >= AN_HOUR,
        ),
    ]


if __name__ == "__main__":
    raise SystemExit(0 if show("competition", measure(int([*sys.argv, COUNT][1]))) else 1)
