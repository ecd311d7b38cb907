"""Is each trial on the road a play of the game of cells? `check --game` on trials of three controllers.

    python -m experiments related
    python -m experiments.related [TRIALS] [JOBS] [FIRST]

The instances are those of `experiments.synthesized`, of 120 s; in every third trial all e-agents are `free`, which do
what they like within E1 to E6. In turn `rules`, `lanes` and `synthesized` drive. A `free` car may turn round in a bend,
of which theorem 3 of docs/theory.md says nothing: what is no play of the game after that is counted apart.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from benchmarks.table import Row, show

from dubins_traffic.problem.kinds import parameters_of
from dubins_traffic.record.reader import Record, read
from dubins_traffic.runs.single import run_trial
from dubins_traffic.synthesis.related import Relation, relate
from dubins_traffic.synthesis.strategy import Strategy
from dubins_traffic.synthesis.synthesized import Synthesized
from experiments.synthesized import instance, save_strategies

TRIALS: Final = 1000
DURATION: Final = 120.0
FREE: Final = parameters_of("free", {})
CONTROLLERS: Final = ("rules", "lanes", "synthesized")


@dataclass(frozen=True, slots=True)
class Found:
    """The relation of a trial, who drove, and whether anyone broke a rule in it, or first turned round in a bend."""

    number: int
    controller: str
    broken: bool
    turned: bool
    relation: Relation

    @property
    def strays(self) -> bool:
        """Whether it should be a play of the game, and is none."""
        return not (self.relation.related or self.turned)


def found(number: int, strategies: str) -> Found:
    """Run a trial and relate it."""
    own, name = instance(number, DURATION), CONTROLLERS[number // 6 % len(CONTROLLERS)]
    if number % 3 == 0:
        free = [replace(agent, kind="free", type="free", parameters=FREE) for agent in own.e_agents]
        own = replace(own, e_agents=tuple(free))
    saved = name == "synthesized" and number % 2 == 0
    strategy = Strategy.load(Path(strategies) / f"{len(own.e_agents)}.npz") if saved else None
    with TemporaryDirectory() as folder:
        path = Path(folder) / "trial.mcap"
        verdict = run_trial(own, Synthesized(strategy) if saved else name, record=path).score.verdict
        record = read(path)
    assert verdict is not None
    relation = relate(record, verdict)
    return Found(number, name, bool(verdict.violations), has_turned(record, relation), relation)


def has_turned(record: Record, relation: Relation) -> bool:
    """Tell whether a car had turned round in a bend by the first move that the game does not know."""
    if relation.unknown is None:
        return False
    network, last = record.instance.problem.network, round(relation.unknown.time * record.frames.rate)
    for lanes in record.frames.lane[: last + 1].T:
        held = lanes[lanes >= 0]
        back = held[1:][held[1:] == held[:-1] ^ 1]
        if any(network.degrees[network.lane_ends(lane)[0]] == 2 for lane in back.tolist()):
            return True
    return False


def relations(count: int = TRIALS, jobs: int = 2, first: int = 0) -> list[Found]:
    """Run `count` trials from a number on, in `jobs` processes."""
    with TemporaryDirectory() as folder, ProcessPoolExecutor(jobs) as pool:
        save_strategies(folder)
        return list(pool.map(partial(found, strategies=folder), range(first, first + count), chunksize=4))


def bars(every: Sequence[Found]) -> list[Row]:
    """Return the table."""
    moves = sum(one.relation.moves for one in every)
    broken = [one for one in every if one.broken]
    strays = sum(one.strays for one in every)
    turned = sum(one.turned and not one.relation.related for one in every)
    renewed, reordered = (sum(getattr(one.relation, name) for one in every) for name in ("renewed", "reordered"))
    crowded = sum(one.relation.crowded for one in every) / len(every)
    rows = [
        Row(
            f"{len(every)} trials of {DURATION:g} s, {moves:,} moves: no plays of the game, of those in theorem 3",
            str(strays), "0", strays == 0,
        ),
        Row("no plays after a car has turned round in a bend, of which theorem 3 says nothing", str(turned), "", True),
        Row("trials in which someone broke a rule", str(len(broken)), "", True),
        Row("places in an order given up", f"{renewed:,}", "", True),
        Row("cars that stopped before one that had come into its lane earlier", f"{reordered:,}", "", True),
        Row("of the time, a place was assumed for a car behind another one", f"{crowded:.1%}", "", True),
    ]  # fmt: skip
    for name in CONTROLLERS:
        longest = max((one.relation.longest_move for one in every if one.controller == name), default=0.0)
        rows.append(Row(f"longest time for a move that `{name}` had", f"{longest:.1f} s", "", True))
    return rows


def measure() -> list[Row]:
    """Run all trials and return the table of the bars."""
    return bars(relations())


def main() -> None:
    """Print the trials that are no play of the game, and the table."""
    every = relations(*(int(argument) for argument in sys.argv[1:4]))
    for one in every:
        if one.strays or one.turned:
            print(one.number, one.controller, one.relation)
    show("trials as plays of the game", bars(every))


if __name__ == "__main__":
    main()
