"""How soon are planted faults found, what does a search cost over a plain batch, and what is found in the drivers.

    python -m benchmarks falsify
    python -m benchmarks.falsify [TRIALS] [SEEDS] [LONG]

The twelve mutants of `rules` that tests plant are searched from SEEDS seeds, by evolution and at random, at most TRIALS
trials each; a search ends with the generation in which its mutant first breaks a rule. `rules` and `lanes+shield` are
searched for LONG trials (`lanes+shield`, which Python asks in every tick, for a hundredth of them) on `junction`, and
`rules` at random for as many.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from tests.mutants import MUTANTS

from benchmarks.table import Row, show
from dubins_traffic.engine.batch import outcomes
from dubins_traffic.falsification import search
from dubins_traffic.falsification.crew import Here
from dubins_traffic.falsification.intervals import clopper_pearson
from dubins_traffic.falsification.search import GENERATION, Found, falsify
from dubins_traffic.falsification.trying import Findings
from dubins_traffic.problem.instance import Instance

TRIALS, SEEDS, LONG = 20_000, 10, 1_000_000
WORLD = "junction"
SHARE = 0.2
"""Share of the trials of a search at random that an evolution may need."""
OVERHEAD = 0.2


class _FoundError(Exception):
    """A search has found what it was to find."""


def measure(trials: int = TRIALS, seeds: int = SEEDS, long: int = LONG) -> list[Row]:
    """Return the rows of this benchmark."""
    rows: list[Row] = []
    quicker = 0
    for name in MUTANTS:
        evolved = [first(name, "evolution", seed, trials) for seed in range(seeds)]
        drawn = [first(name, "uniform", seed, trials) for seed in range(seeds)]
        found = sum(own is not None for own in evolved)
        middle, chance = (median(own, trials) for own in (evolved, drawn))
        quicker += middle <= SHARE * chance
        told = f"{found} of {seeds} seeds, median {middle:,.0f} trials; at random {chance:,.0f}"
        rows.append(
            Row(f"mutant {name} found within {trials:,} trials", told, "9 of 10 seeds", found >= 0.9 * seeds)
        )
    half = len(MUTANTS) / 2
    rows.append(
        Row("mutants on which a fifth of the trials is enough", f"{quicker}", "half", quicker >= half)
    )
    return [*rows, overhead(), *drivers(long)]


def first(name: str, strategy: str, seed: int, trials: int) -> int | None:
    """Return how many trials a search ran until its mutant broke a rule, None if it did not."""
    with tempfile.TemporaryDirectory() as folder:
        found = 0

        def look(own: search.Search) -> None:
            nonlocal found
            if own.archive.cases:
                found = own.counts.trials
                raise _FoundError

        try:
            falsify(
                WORLD, MUTANTS[name].kind, Path(folder) / "found", rules=MUTANTS[name].rules, trials=trials, seed=seed,
                strategy=strategy, progress=look,
            )  # fmt: skip
        except _FoundError:
            return found
    return None


def median(counts: Sequence[int | None], most: int) -> float:
    """Return the median of counts, of which None stands for more than `most`."""
    return statistics.median([2 * most if count is None else count for count in counts])


class _Watched(Here):
    """Runs trials here, and keeps them."""

    seen: list[Instance]

    def run(self, instances: Sequence[Instance]) -> Findings:
        """Run the trials of instances."""
        self.seen += instances
        return super().run(instances)


def overhead(trials: int = 32 * GENERATION) -> Row:
    """Return what a search of `rules` takes over a plain batch of the same trials."""
    crew = _Watched("rules", "rules")
    crew.seen = []

    @contextmanager
    def watched(*_: object) -> Iterator[Here]:
        yield crew

    real = search.crew_of
    search.crew_of = watched  # pyright: ignore[reportAttributeAccessIssue]  # the search is timed with a crew that watches
    try:
        with tempfile.TemporaryDirectory() as folder:
            falsify(WORLD, "rules", Path(folder) / "warm", trials=GENERATION, seed=1)
            crew.seen.clear()
            began = time.perf_counter()
            falsify(WORLD, "rules", Path(folder) / "found", trials=trials, seed=2)
            searched = time.perf_counter() - began
    finally:
        search.crew_of = real
    began = time.perf_counter()
    for first_one in range(0, len(crew.seen), GENERATION):
        list(outcomes(crew.seen[first_one : first_one + GENERATION], "rules", batch=GENERATION))
    plain = time.perf_counter() - began
    more = searched / plain - 1.0
    told = f"{1e3 * searched / trials:.2f} ms a trial, {more:.0%} over {1e3 * plain / trials:.2f} ms"
    return Row(f"search of rules, {trials:,} trials of 15 s", told, f"<= {OVERHEAD:.0%}", more <= OVERHEAD)


def drivers(trials: int) -> list[Row]:
    """Return what searches find in `rules` and `lanes+shield`, and how seldom `rules` fails at random."""
    rows: list[Row] = []
    for name, count in (("rules", trials), ("lanes+shield", trials // 100)):
        found = _searched(name, "evolution", count)
        rows.append(
            Row(f"{name}, {count:,} searched trials: broke a rule in", _told(found), "0", not found.violated)
        )
    found = _searched("rules", "uniform", trials)
    low, high = clopper_pearson(found.violated, found.trials)
    told = f"{_told(found)}; 95 % interval {low:.1e} to {high:.1e}"
    rows.append(Row(f"rules, {trials:,} trials at random: broke a rule in", told, "0", not found.violated))
    return rows


def _searched(controller: str, strategy: str, trials: int) -> Found:
    with tempfile.TemporaryDirectory() as folder:
        return falsify(WORLD, controller, Path(folder) / "found", trials=trials, seed=1, strategy=strategy)


def _told(found: Found) -> str:
    return f"{found.violated} ({', '.join(found.cases) or 'nothing'}); {found.discarded} discarded"


if __name__ == "__main__":
    raise SystemExit(not show("falsify", measure(*map(int, sys.argv[1:]))))
