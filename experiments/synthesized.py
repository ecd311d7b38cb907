"""How a strategy of the game of cells does on the road: `synthesized` among `lawful` e-agents and a `nemesis`.

    python -m experiments.synthesized [TRIALS] [JOBS] [FIRST]

Each trial is 300 s with 1 to 3 e-agents: `lawful` ones that wander or go between places, with one `nemesis` among them
in about every other trial. Half of the trials are on the 3x4 grid, with goals at two opposite corners and strategies
that have been saved; the others on random networks of 6 to 9 intersections with 1 to 4 goals, whose games are solved
when they start. Some of these games are lost; then the ego drives as `rules` does where its strategy does not win.
Free flow is that of `experiments.free_flow`.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.table import Row, show

from dubins_traffic.kernels.philox import Draws
from dubins_traffic.problem.instance import Instance
from dubins_traffic.protocols import End, Ending
from dubins_traffic.record.sink import Frames
from dubins_traffic.routing.rounds import round_time
from dubins_traffic.runs.single import run_trial
from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.game import build
from dubins_traffic.synthesis.instance import assumption_of, cells_of
from dubins_traffic.synthesis.road_play import NEW_TICKET, UNKNOWN_MOVE
from dubins_traffic.synthesis.solver import solve
from dubins_traffic.synthesis.strategy import Strategy
from dubins_traffic.synthesis.synthesized import STRATEGY_LEFT, Synthesized
from experiments.drawing import random_roads, random_trial
from experiments.free_flow import free_flow

DURATION = 300.0
TRIALS = 2000
MOST_ROUNDS = 10.0
GRID = {"grid": {"rows": 3, "columns": 4}}
CORNERS = ((0, 0), (3, 2))


@dataclass(frozen=True, slots=True)
class Drive:
    """One trial: breaches of the ego and of the others, events of the play by kind, rounds, longest gap in rounds."""

    number: int
    kind: str
    agents: int
    intersections: int
    own: tuple[str, ...]
    others: tuple[str, ...]
    collisions: int
    checked: int
    events: dict[str, int]
    unknown: tuple[str, ...]
    rounds: int
    free_rounds: int
    gap: float
    begin: float


class Events:
    """Keeps the events of a trial."""

    def begin(self, _instance: Instance) -> None:
        self.found: list[tuple[float, str, str]] = []

    def frames(self, frames: Frames) -> None:
        self.found += [(event.tick / frames.rate, event.kind, event.detail) for event in frames.events]

    def end(self, _ending: Ending) -> None:
        pass


def instance(
    number: int, seconds: float = DURATION, seed: int = 2016, network: dict[str, Any] | None = None
) -> Instance:
    """Return the instance of a number: on the grid if it is even, else on a random network; on another if given."""
    draws = Draws(seed, number, 902)
    agents: list[dict[str, Any]] = [
        {
            "type": "lawful",
            "name": f"car{k}",
            "parameters": {"goes": ("wander", "places")[draws.below(2)]},
        }
        for k in range(draws.between(1, 3))
    ]
    if draws.below(2):
        agents[0] = {"type": "nemesis", "name": "nemesis"}
    if network is not None:
        return random_trial(network, agents, seconds, seed, number, rules=True)
    network = GRID if number % 2 == 0 else random_roads(draws, 9, 1.0)
    drawn = random_trial(network, agents, seconds, seed, number, rules=True)
    return replace(drawn, problem=replace(drawn.problem, goals=CORNERS)) if number % 2 == 0 else drawn


def drive(number: int, seconds: float = DURATION, strategies: str | None = None) -> Drive:
    """Run `synthesized` on an instance, with strategies for the grid in a folder if there is one."""
    own = instance(number, seconds)
    kind = "nemesis" if own.e_agents[0].kind == "nemesis" else "lawful"
    saved = strategies is not None and number % 2 == 0
    strategy = Strategy.load(Path(strategies or "") / f"{len(own.e_agents)}.npz") if saved else None
    controller = Synthesized(strategy)
    events = Events()
    result = run_trial(own, controller, sinks=[events])
    verdict = result.score.verdict
    assert verdict is not None
    assert result.ending.end is End.DURATION, result.ending
    gap, free = verdict.longest_gap_s, free_flow(own)
    assert gap is not None
    return Drive(
        number,
        kind,
        len(own.e_agents),
        len(own.problem.network.intersections),
        tuple(one.rule for one in verdict.violations if one.car == "ego"),
        tuple(one.rule for one in verdict.violations if one.car != "ego"),
        len(result.score.collisions) + result.score.collisions_among_others,
        controller.play.checked if controller.play else 0,
        dict(Counter(kind for _, kind, _ in events.found)),
        tuple(f"{time:.2f} {detail}" for time, kind, detail in events.found if kind == UNKNOWN_MOVE),
        result.score.rounds,
        free.rounds(seconds),
        gap / round_time(own.problem.network, own.problem.goal_vertices, own.problem.car.bounds.speed),
        result.wall.time_to_begin_s or 0.0,
    )


def save_strategies(folder: str) -> None:
    """Write the strategies for the grid against 1 to 3 e-agents."""
    for cars in (1, 2, 3):
        problem = instance(0).problem
        board = Board(cells_of(problem), assumption_of(problem), cars)
        Strategy.of(solve(build(board))).save(Path(folder) / f"{cars}.npz")


def bars(drives: Sequence[Drive]) -> list[Row]:
    """Return the table of the bars."""
    trials = f"{len(drives)} trials"
    unclean = sum(1 for one in drives if one.own)
    broke = sum(1 for one in drives if one.others)
    late = sum(1 for one in drives if one.gap > MOST_ROUNDS) / len(drives)
    events: Counter[str] = Counter()
    for one in drives:
        events.update(one.events)
    begin = sorted(one.begin for one in drives)
    unknown = events[UNKNOWN_MOVE]
    return [
        Row(f"{trials}: not clean", str(unclean), "0", unclean == 0),
        Row("in which e-agents break a rule", str(broke), "", True),
        Row("no goal gap over 10 free-flow rounds", f"{100 * (1 - late):.1f} %", ">= 95 %", late <= 0.05),
        Row(f"of {sum(one.checked for one in drives)} moves unknown", str(unknown), "0", unknown == 0),
        Row("places in the order given up", str(events[NEW_TICKET]), "", True),
        Row("strategy left for want of a winning position", str(events[STRATEGY_LEFT]), "", True),
        Row("time to begin, median and most", f"{statistics.median(begin):.2f} s, {begin[-1]:.2f} s", "", True),
    ]


def drives(count: int = TRIALS, jobs: int = 2, first: int = 0) -> list[Drive]:
    """Run `count` trials, in `jobs` processes."""
    with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor(jobs) as pool:
        save_strategies(folder)
        return list(pool.map(partial(drive, strategies=folder), range(first, first + count), chunksize=4))


def measure() -> list[Row]:
    """Run all trials and return the table of the bars."""
    return bars(drives())


def main() -> None:
    """Print what is remarkable, and the table."""
    found = drives(*(int(argument) for argument in sys.argv[1:4]))
    for one in found:
        if one.own or one.others or one.collisions or one.unknown or one.gap > MOST_ROUNDS:
            print(one)
    show("a strategy on the road", bars(found))


if __name__ == "__main__":
    main()
