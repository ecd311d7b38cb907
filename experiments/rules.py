"""How the cars that keep the rules of the road do: `rules` among `lawful`, `nemesis` and those that break rules.

    python -m experiments.rules [TRIALS] [JOBS] [FIRST]

Each trial is 300 s on a random network of 6 to 40 intersections (anything from a tree to halfway as many segments as
a grid has), with 1 to 4 goals and 1 to 6 e-agents. `lawful`: they wander, loop or go between places. `nemesis`: one
nemesis among them. `breakers`: each breaks every rule that it may break. Of TRIALS trials of the first kind, a fifth as
many are run of each of the others. Free flow is that of `experiments.free_flow`.
"""

from __future__ import annotations

import statistics
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from benchmarks.table import Row, show

from dubins_traffic.kernels.philox import Draws
from dubins_traffic.problem.instance import Instance
from dubins_traffic.protocols import Ending
from dubins_traffic.record.sink import Frames
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.runs.single import run_trial
from experiments.drawing import random_roads, random_trial
from experiments.free_flow import free_flow

DURATION = 300.0
KINDS = ("lawful", "nemesis", "breakers")
BREAKS = {"rolls": 0.2, "left": 0.1, "blocks": 0.1, "tailgates": 0.3, "parks": 0.3, "parks_for": 60.0}


@dataclass(frozen=True, slots=True)
class Drive:
    """One trial: breaches of the ego and of the others, collisions, those with the ego at fault, rounds, waiting."""

    number: int
    kind: str
    intersections: int
    agents: int
    own: tuple[str, ...]
    others: tuple[str, ...]
    collisions: int
    at_fault: int
    rounds: int
    free_rounds: int
    distance: float
    waited: float


class Waiting:
    """Measures the longest time for which any car has stood at a stop line."""

    def begin(self, instance: Instance) -> None:
        self._rate = instance.problem.rate
        self._run = np.zeros(len(instance.starts), dtype=np.int64)
        self._longest = 0

    def frames(self, frames: Frames) -> None:
        for stopped in (frames.bits & FLAG.STOPPED) != 0:
            self._run = np.where(stopped, self._run + 1, 0)
            self._longest = max(self._longest, int(self._run.max()))

    def end(self, _ending: Ending) -> None:
        self._seconds = self._longest / self._rate

    def result(self) -> float:
        return self._seconds


def e_agents(kind: str, count: int, draws: Draws) -> list[dict[str, Any]]:
    """Return the e-agents of a configuration; `kind` may be the name of one rule that all of them break."""
    given = BREAKS if kind == "breakers" else {kind: 1.0} if kind in BREAKS else {}
    agents = [
        {"type": "lawful", "name": f"car{k}", "parameters": {"goes": goes, **given}}
        for k, goes in enumerate(("wander", "loop", "places")[draws.below(3)] for _ in range(count))
    ]
    if kind == "nemesis":
        agents[0] = {"type": "nemesis", "name": "nemesis"}
    return agents


def instance(
    number: int,
    kind: str = "lawful",
    seconds: float = DURATION,
    seed: int = 2016,
    body: Mapping[str, Any] | None = None,
) -> Instance:
    """Return the random instance of a number; `body` is the `car` of its configuration."""
    draws = Draws(seed, number, 901)
    network = random_roads(draws, 40, 0.5)
    agents = e_agents(kind, draws.between(1, 6), draws)
    car = {} if body is None else {"car": body}
    return random_trial(network, agents, seconds, seed, number, rules=True, **car)


def drive(number: int, kind: str = "lawful", seconds: float = DURATION, body: Mapping[str, Any] | None = None) -> Drive:
    """Run `rules` on an instance, with a car of its own if `body` says so."""
    own = instance(number, kind, seconds, body=body)
    watch = Waiting()
    score = run_trial(own, "rules", sinks=[watch]).score
    verdict = score.verdict
    assert verdict is not None
    flow = free_flow(own)
    return Drive(
        number,
        kind,
        len(own.problem.network.intersections),
        len(own.e_agents),
        tuple(one.rule for one in verdict.violations if one.car == "ego"),
        tuple(one.rule for one in verdict.violations if one.car != "ego"),
        len(score.collisions) + score.collisions_among_others,
        sum(one.at_fault for one in score.collisions),
        score.rounds,
        flow.rounds(seconds),
        score.driven.distance_m / flow.distance(seconds),
        watch.result(),
    )


def bars(drives: Sequence[Drive]) -> list[Row]:
    """Return the table of the bars."""
    rows: list[Row] = []
    for kind in KINDS:
        own = [one for one in drives if one.kind == kind]
        if not own:
            continue
        trials = f"{kind}, {len(own)} trials"
        unclean = sum(1 for one in own if one.own)
        faults = sum(one.at_fault for one in own)
        if kind != "breakers":
            rows.append(Row(f"{trials}: not clean", str(unclean), "0", unclean == 0))
        rows.append(Row(f"{trials}: collisions with the ego at fault", str(faults), "0", faults == 0))
        if kind == "lawful":
            rows += _orderly(trials, own)
        elif kind == "nemesis":
            broke = sum(1 for one in own if one.others)
            rows.append(Row(f"{trials}: in which e-agents break a rule", str(broke), "0", broke == 0))
    return rows


def _orderly(trials: str, drives: Sequence[Drive]) -> list[Row]:
    collisions = sum(one.collisions for one in drives)
    broke = sum(1 for one in drives if one.others)
    counted = [one for one in drives if one.free_rounds]
    enough = sum(1 for one in counted if one.rounds >= 0.3 * one.free_rounds) / max(len(counted), 1)
    waited = max(one.waited for one in drives)
    distance = statistics.median(one.distance for one in drives)
    return [
        Row(f"{trials}: collisions", str(collisions), "0", collisions == 0),
        Row(f"{trials}: in which e-agents break a rule", str(broke), "0", broke == 0),
        Row("30 % of the free-flow rounds made", f"{100 * enough:.1f} % of trials", ">= 95 %", enough >= 0.95),
        Row("longest time at a stop line", f"{waited:.1f} s", "<= 60 s", waited <= 60.0),
        Row("median distance per free-flow distance", f"{distance:.3f}", "", True),
    ]


def drives(count: int = 1000, jobs: int = 2, first: int = 0) -> list[Drive]:
    """Run `count` trials with `lawful` e-agents and a fifth as many of the other kinds, in `jobs` processes."""
    found: list[Drive] = []
    with ProcessPoolExecutor(jobs) as pool:
        for kind in KINDS:
            last = first + (count if kind == "lawful" else max(count // 5, 1))
            found += pool.map(partial(drive, kind=kind), range(first, last), chunksize=4)
    return found


def measure() -> list[Row]:
    """Run all trials and return the table of the bars."""
    return bars(drives())


def main() -> None:
    """Print what is remarkable, and the table."""
    found = drives(*(int(argument) for argument in sys.argv[1:4]))
    for one in found:
        slow = one.rounds < 0.3 * one.free_rounds
        if one.own or one.at_fault or (one.kind != "breakers" and (one.others or one.collisions or slow)):
            print(one)
    show("rules of the road", bars(found))


if __name__ == "__main__":
    main()
