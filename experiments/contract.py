"""Both sides of the contract, searched for a million trials each: who keeps E1 to E6 and blocks, who is provoked?

    python -m experiments contract
    python -m experiments.contract [--trials N] [--seconds S] [--searches NAME,...] [--seed K] [--workers W] [--store]

`rules` and `lanes+shield` drive among `free` e-agents, which search through what E1 to E6 allow: in how many trials do
they wait for a visit longer than the limit, though nobody has broken a rule? And an ego that is any program under the
shield (`experiments.free_egos`) drives among `lawful` cars: in how many trials is one of these the first to break a
rule? Each search ends after N trials, a million unless said otherwise, or S seconds, a day. Its folder below
`build/contract` is of the package's sources; Ctrl-C keeps what is done, and the next call goes on. With --store the
counts so far are kept as the result of the experiment, whatever the number of trials; another seed, on another machine
or day, adds to those of the same sources. Until a search has come to a million with these, one count of earlier sources
stays beside: the last that did, else the greatest.
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from benchmarks.table import Row, show

from dubins_traffic.falsification.contract import BLOCKED, PROVOKED
from dubins_traffic.falsification.search import GENERATION, falsify
from dubins_traffic.problem.configuration import Configuration
from experiments.stored import code, load, store, write_page

ROOT: Final = Path(__file__).resolve().parents[1]
FOLDER: Final = ROOT / "build" / "contract"
RESTS_ON: Final = (ROOT / "experiments" / "free_egos.py", ROOT / "tests" / "mutated.py")
"""The egos that are searched."""
TRIALS: Final = 1_000_000
DAY: Final = 86_400.0
SEED: Final = 1


def world(grid: tuple[int, int], length: float, agents: list[dict[str, Any]], **more: Any) -> dict[str, Any]:
    """Return the configuration of a grid with two goals two segments apart, at 10 Hz."""
    return {
        "version": 1, "problem_domain": "dubins_traffic", "rate": 10, "rules": True, "number_goals_bounds": [2, 2],
        "network": {"grid": {"rows": grid[0], "columns": grid[1], "length": length}}, "goal_segments_apart": 2,
        "e-agents": agents,
    } | more  # fmt: skip


FREE: Final = [{"type": "free", "name": "free", "count": 2}]
SOON: Final = {"rest_time": 40.0, "journey_start_time": 8.0, "goal_time": 20.0, "gap_rounds": 17.5}
"""Limits by which all that others may do to make the ego wait is over after 350 s: so 440 s show it.

A shorter time for a journey would leave a free car none in which it does as it likes (`agents.free.RESERVE`)."""
WAITING: Final = world((2, 2), 3.5, FREE, rules=SOON, duration=440)
OBSTACLE: Final[dict[str, Any]] = {
    "version": 1, "problem_domain": "dubins_traffic", "rate": 10, "rules": SOON | {"gap_rounds": 10.0},
    "goals": [[0, 0], [2, 1]], "duration": 440, "e-agents": [{"type": "free", "name": "free"}],
    "rnd": {
        "version": 0, "length": 4.5, "transform": [0, 0, 0], "shape": [2, 3],
        "segments": [[0, 0, 1, 0], [1, 0, 1, 1], [1, 1, 2, 1]],
    },
    "obstacles": [{"disc": {"x": 4.8, "y": 2.25, "radius": 0.1}}],
}  # fmt: skip
PROVOKING: Final = world((2, 3), 4.0, [{"type": "lawful", "name": "lawful", "count": 4}], duration=120)
AMONG_FREE: Final = world(
    (2, 3), 4.0, [*FREE, {"type": "lawful", "name": "lawful"}], rules={"gap_rounds": 4.0}, duration=120
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Wanted:
    """A search: who drives, in which configuration, what is looked for, in words, and whether none is the bar."""

    controller: str
    world: dict[str, Any]
    target: str
    says: str
    bar: bool = True
    most: int = GENERATION
    """Trials at a time; of an ego in Python more, which is twice as quick."""


SEARCHES: Final = {
    "rules": Wanted(
        "rules", WAITING, BLOCKED, "`rules` between two free cars on a ring of four bends, trials of 440 s"
    ),
    "lanes": Wanted(
        "lanes+shield", WAITING, BLOCKED, "`lanes+shield`, which waits for more than the rules ask, the same",
        bar=False,
    ),
    "egos": Wanted(
        "experiments.free_egos:Free", PROVOKING, PROVOKED,
        "any program under the shield among four lawful cars, trials of 120 s", most=1024,
    ),
    "obstacle": Wanted(
        "rules", OBSTACLE, BLOCKED, "`rules` and a free car on an elbow, an obstacle in the only way, trials of 440 s",
        bar=False,
    ),
    "obstacle-two": Wanted(
        "rules", OBSTACLE | {"e-agents": FREE}, BLOCKED, "the same with two free cars, more than the ego bears there",
        bar=False,
    ),
    "elbow-two": Wanted(
        "rules", {key: OBSTACLE[key] for key in OBSTACLE if key != "obstacles"} | {"e-agents": FREE}, BLOCKED,
        "the same without the obstacle", bar=False,
    ),
    "among-free": Wanted(
        "rules", AMONG_FREE, PROVOKED, "`rules` among two free cars and a lawful one, trials of 120 s", bar=False
    ),
}  # fmt: skip
"""The searches by name. Those without a bar measure what is not claimed for so many trials, or not at all. On an elbow
the ego bears one e-agent (theorem 1 of docs/theory.md)."""
HAPPENS: Final = {
    BLOCKED: "without a visit for longer than may be, though nobody has broken a rule",
    PROVOKED: "a lawful car is the first to break a rule",
}


@dataclass(frozen=True, slots=True)
class Count:
    """What a search of one seed has come to, with the sources of `code`."""

    search: str
    code: str
    seed: int
    trials: int
    found: int
    discarded: int
    kinds: tuple[str, ...]


def searched(name: str, trials: int, seconds: float, seed: int, workers: int) -> Count:
    """Search, or go on where an earlier search of the same sources and seed ended, and count what has been found."""
    own, sources = SEARCHES[name], code(*RESTS_ON)
    folder = FOLDER / sources / f"{name}-{seed}"
    began = time.monotonic()
    found = falsify(
        Configuration.from_document(own.world), own.controller, folder, rules=[own.target], trials=trials,
        seconds=seconds, seed=seed, duration=None, workers=workers, resume=folder.exists(), most=own.most,
    )  # fmt: skip
    took = time.monotonic() - began
    print(f"{name}: {found.trials:,} trials, {found.violated} found, {took:.0f} s", flush=True)
    for case in found.cases.values():
        print(f"  {case.story.sentence}", flush=True)
    return Count(name, sources, seed, found.trials, found.violated, found.discarded, tuple(sorted(found.cases)))


def together(counts: Iterable[Count]) -> list[Count]:
    """Return counts with those that are stored of the same sources, and of searches with few of them, of earlier ones.

    They are in the order of the searches, those of later sources first. Of earlier ones the last that came to `TRIALS`
    stays, else the greatest.
    """
    before = load("contract")
    stored = [Count(**{**count, "kinds": tuple(count["kinds"])}) for count in (before.counts if before else ())]
    sources = code(*RESTS_ON)
    latest = {(count.search, count.code, count.seed): count for count in (*stored, *counts)}
    found: list[Count] = []
    for name in SEARCHES:
        by_code = defaultdict[str, list[Count]](list)
        for count in latest.values():
            if count.search == name:
                by_code[count.code].append(count)
        here = by_code.pop(sources, [])
        found += here
        if _trials(here) < TRIALS:
            found += max(by_code.values(), key=lambda counts: min(TRIALS, _trials(counts)), default=[])
    return found


def _trials(counts: Iterable[Count]) -> int:
    return sum(count.trials for count in counts)


def rows(counts: Iterable[Count]) -> list[Row]:
    """Return a row for each search and state of the sources of which there are counts."""
    now, groups = code(*RESTS_ON), defaultdict[tuple[str, str], list[Count]](list)
    for count in counts:
        groups[count.search, count.code].append(count)
    return [_row(SEARCHES[name], own, earlier=sources != now) for (name, sources), own in groups.items()]


def _row(own: Wanted, counts: list[Count], *, earlier: bool) -> Row:
    trials, found, discarded = (
        sum(getattr(count, name) for count in counts) for name in ("trials", "found", "discarded")
    )
    kinds = ", ".join(sorted({kind for count in counts for kind in count.kinds}))
    told = f"{found:,}" + (f" ({kinds})" if kinds else "")
    more = f"; {discarded:,} in which somebody broke a rule before the ego did"
    bar = f"0 of {TRIALS:,}" if own.bar else ""
    met = not own.bar or (not found and trials >= TRIALS)
    when = ", of earlier sources" if earlier else ""
    return Row(f"{own.says}, {trials:,} searched{when}: {HAPPENS[own.target]}", told + more, bar, met)


def measure() -> list[Row]:
    """Return the rows of this experiment."""
    return rows(searched(name, TRIALS, DAY, SEED, 1) for name in SEARCHES)


def main() -> int:
    """Search as asked, and print the table."""
    parser = argparse.ArgumentParser(prog="experiments.contract")
    parser.add_argument("--trials", type=int, default=TRIALS)
    parser.add_argument("--seconds", type=float, default=DAY)
    parser.add_argument("--searches", default=",".join(SEARCHES), metavar="NAME,...")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--store", action="store_true")
    asked = parser.parse_args()
    counts = [
        searched(name, asked.trials, asked.seconds, asked.seed, asked.workers) for name in asked.searches.split(",")
    ]
    if asked.store:
        counts = together(counts)
        store("contract", rows(counts), [asdict(count) for count in counts])
        write_page()
    return 0 if show("contract", rows(counts)) else 1


if __name__ == "__main__":
    raise SystemExit(main())
