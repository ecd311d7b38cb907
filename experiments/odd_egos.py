"""Can an odd ego, clean as it is, bring a car that keeps the law to a breach of E1 to E6?

    python -m experiments odd_egos
    python -m experiments.odd_egos [TRIALS] [JOBS] [FIRST]

Each trial is 120 s. Of two trials one is on a grid, with up to a third of its segments removed, the other on a random
network of 6 to 24 intersections. One in three has obstacles in and beside the lanes, just behind intersections too, but
none that bars a goal or the way to it.
There are 1 to 7 e-agents: `lawful` ones that wander, loop or go between places; in one trial of four a `nemesis` is
among them, and one of sixteen has a team `counter`. The kinds of `experiments.odd_drivers` take turns. A trial in which
the ego is not clean does not count.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any

from benchmarks.table import Row, show

from dubins_traffic.kernels.philox import Draws
from dubins_traffic.problem.instance import Instance
from dubins_traffic.protocols import End
from dubins_traffic.runs.single import run_trial
from experiments.drawing import random_roads, random_trial
from experiments.odd_drivers import KINDS
from experiments.rules import e_agents

DURATION = 120.0
SEED = 2016
TRIALS = 2000
NAMES = tuple(kind.__name__.lower() for kind in KINDS)


@dataclass(frozen=True, slots=True)
class Oddity:
    """One trial: the ego's kind and breaches, the others' as "rule car time", and what kind of traffic there was."""

    number: int
    kind: str
    traffic: str
    end: str
    own: tuple[str, ...]
    others: tuple[str, ...]
    moved: float

    @property
    def counts(self) -> bool:
        """Whether the ego was clean for all of the trial."""
        return not self.own and self.end == str(End.DURATION)


def kind_of(number: int) -> int:
    """Return which of KINDS drives in a trial: they take turns, each in every kind of traffic."""
    return (number + number // len(KINDS)) % len(KINDS)


def instance(number: int, seconds: float = DURATION) -> Instance:
    """Return the random instance of a number."""
    draws = Draws(SEED, number, 911)
    on_grid, blocked, nemesis, team = (draws.below(n) == 0 for n in (2, 3, 4, 16))
    network = _grid(draws, team) if on_grid or team else random_roads(draws, 24, 0.6)
    agents = e_agents("nemesis" if nemesis else "lawful", draws.between(1, 7), draws)
    if team:
        agents = [{"type": "counter", "name": f"car{k}"} for k in range(2)]
    more: dict[str, Any] = {}
    if blocked and not team:
        more["obstacles"] = _obstacles(random_trial(network, agents, seconds, SEED, number, rules=True), draws)
    return random_trial(network, agents, seconds, SEED, number, rules=True, **more)


def _grid(draws: Draws, small: bool) -> dict[str, Any]:
    """Return a grid of 2 by 2 to 4 by 4 intersections; a `small` one is whole, 2 by 3."""
    rows, columns = (2, 3) if small else (draws.between(2, 4), draws.between(2, 4))
    removed = 0.0 if small else max(0.0, draws.uniform(-0.3, 0.33))
    return {"grid": {"rows": rows, "columns": columns, "removed": removed, "rigid_motion": True}}


def _obstacles(bare: Instance, draws: Draws) -> list[dict[str, Any]]:
    """Return discs in and beside lanes and outside intersections, at most two or one for every four lanes."""
    network = bare.problem.network
    found: list[dict[str, Any]] = []
    for _ in range(draws.between(1, max(2, network.lanes // 4))):
        (x0, y0), (x1, y1) = network.lane_line(draws.below(network.lanes), draws.uniform(-0.7, 0.1))
        radius = draws.uniform(0.05, 0.2)
        least = (bare.problem.intersection_radius + radius) / math.hypot(x1 - x0, y1 - y0)
        share = draws.uniform(least, 1.0 - least)
        x, y = x0 + share * (x1 - x0), y0 + share * (y1 - y0)
        found.append({"disc": {"x": x, "y": y, "radius": radius}})
    return found


def trial(number: int, seconds: float = DURATION) -> Oddity:
    """Run the trial of a number."""
    own = instance(number, seconds)
    kind = kind_of(number)
    score = run_trial(own, KINDS[kind](number)).score
    verdict = score.verdict
    assert verdict is not None
    traffic = sorted({agent.kind for agent in own.e_agents} | ({"obstacles"} if own.problem.obstacles else set()))
    return Oddity(
        number,
        NAMES[kind],
        "+".join(traffic),
        str(score.end),
        tuple(one.rule for one in verdict.violations if one.car == "ego"),
        tuple(f"{one.rule} {one.car} {one.since:.2f}-{one.time:.2f}" for one in verdict.violations if one.car != "ego"),
        score.driven.distance_m,
    )


def bars(found: Sequence[Oddity]) -> list[Row]:
    """Return the table of the bars, by kind of ego."""
    rows: list[Row] = []
    for name in NAMES:
        own = [one for one in found if one.kind == name]
        counted = [one for one in own if one.counts]
        broke = sum(1 for one in counted if one.others)
        words = f"{name}, {len(own)} trials, {len(own) - len(counted)} not clean: in which an e-agent breaks a rule"
        rows.append(Row(words, str(broke), "0", broke == 0))
    counted = [one for one in found if one.counts]
    broke = sum(1 for one in counted if one.others)
    rows.append(Row(f"all {len(counted)} clean trials", str(broke), "0", broke == 0))
    unclean = len(found) - len(counted)
    rows.append(Row("trials that do not count: the ego is not clean", str(unclean), "", True))
    return rows


def trials(count: int = TRIALS, jobs: int = 2, first: int = 0, seconds: float = DURATION) -> list[Oddity]:
    """Run `count` trials in `jobs` processes."""
    found: list[Oddity] = []
    with ProcessPoolExecutor(jobs) as pool:
        for one in pool.map(partial(trial, seconds=seconds), range(first, first + count)):
            found.append(one)
            if one.others or not one.counts:
                print(one, flush=True)
    return found


def measure() -> list[Row]:
    """Run all trials and return the table of the bars."""
    return bars(trials())


def main() -> None:
    """Print what is remarkable, and the table."""
    show("odd egos", bars(trials(*(int(argument) for argument in sys.argv[1:4]))))


if __name__ == "__main__":
    main()
