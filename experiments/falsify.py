"""How soon are planted faults found, what does a search cost over a plain batch, and what is found in the drivers.

    python -m experiments falsify
    python -m experiments.falsify [TRIALS] [SEEDS] [LONG] [--rows FILE] [--begin SEED] [--crossing]

The twelve mutants of `rules` that tests plant are searched from SEEDS seeds, SEED and those after it, by evolution, at
most TRIALS trials each, for a breach of any rule; what counts is the trial in which the first breach was. Then they are
tried at random from the same seeds, no longer than it takes to tell whether chance needs five times as many: a run
without a breach in five times the evolution's median is given up, the row says how many were, and six of ten are
enough. They drive in a town of sixteen intersections with two other cars (`TOWN`): there random trials hardly ever
meet a corner, whereas on the single crossing of `junction` everybody meets everybody. Each search is a line of FILE
as soon as it is over, and is not run again as long as the search, the mutants and the town are the same. `rules` and
`lanes+shield` are searched for LONG trials on `junction`, and `rules` at random for as many: hours, in folders beside
FILE from which an interrupted search goes on; with LONG = 0 neither is.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import statistics
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from benchmarks.table import Row, show
from tests import mutants, mutated
from tests.mutant_searches import TOWN, first
from tests.mutants import MUTANTS

from dubins_traffic.campaign.report.statistics import clopper_pearson
from dubins_traffic.engine.batch import outcomes
from dubins_traffic.falsification import search
from dubins_traffic.falsification.archive import Found
from dubins_traffic.falsification.search import GENERATION, falsify
from dubins_traffic.falsification.trying import LocalRunner, Tried
from dubins_traffic.problem.configuration import Configuration, load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance

TRIALS, SEEDS, LONG = 20_000, 10, 1_000_000
BEGIN = 100
"""The first seed of the mutants: the operators of the search were chosen by seeds below ten."""
WORLD = "junction"
AT_CROSSING = ("tie_by_index", "wide_group", "forgets_forfeit", "left_long", "swerves")
"""Mutants that take some trials there; the others are found within twenty, by chance, too."""
MOST_THERE = 3_000
ROWS = Path("build/falsify-rows.jsonl")
SHARE = 0.2
"""Share of the trials of a search at random that an evolution may need."""
OVERHEAD = 0.2


class Hits:
    """The trials in which searches first found a breach, one line of a file each.

    Parameters
    ----------
    file : Path
        The file; made if missing.
    """

    def __init__(self, file: Path) -> None:
        self._file, self._code = file, code_of_searches()
        self._known: dict[tuple[object, ...], tuple[int | None, int]] = {}
        for line in file.read_text().splitlines() if file.exists() else []:
            row = json.loads(line)
            if row["code"] == self._code:
                self._known[row["mutant"], row["strategy"], row["seed"]] = row["hit"], row["trials"]

    def first(self, mutant: str, strategy: str, seed: int, trials: int) -> int | None:
        """Return after how many trials a search found its first breach, None if it found none in `trials`."""
        key = mutant, strategy, seed
        hit, tried = self._known.get(key, (None, 0))
        if hit is None and tried < trials:
            began = time.process_time()
            hit = first(mutant, strategy, seed, trials)
            self._known[key] = hit, trials
            seconds = round(time.process_time() - began, 1)
            row = {"mutant": mutant, "strategy": strategy, "seed": seed, "trials": trials, "code": self._code}
            self._file.parent.mkdir(parents=True, exist_ok=True)
            with self._file.open("a") as file:
                file.write(json.dumps(row | {"hit": hit, "seconds": seconds}) + "\n")
            told = f"none in {trials:,}" if hit is None else f"{hit:,}"
            print(f"{mutant}, {strategy}, seed {seed}: {told}, {seconds} s of a processor", flush=True)
        return None if hit is None or hit > trials else hit


def code_of_searches() -> str:
    """Return a digest of what the trials of a search follow from, as far as it is likely to change."""
    files = [*Path(search.__file__).parent.glob("*.py"), *(Path(own.__file__) for own in (mutants, mutated))]
    whole = b"".join(path.read_bytes() for path in sorted(files)) + json.dumps(TOWN).encode()
    return hashlib.sha256(whole).hexdigest()[:16]


def measure(
    trials: int = TRIALS, seeds: int = SEEDS, long: int = LONG, file: Path = ROWS, begin: int = BEGIN
) -> list[Row]:
    """Return the rows of this experiment."""
    rows = planted(trials, range(begin, begin + seeds), file)
    return [
        *rows,
        *crossing(range(begin, begin + seeds)),
        *overheads(),
        *(drivers(long, file.parent) if long else ()),
    ]


def planted(trials: int, seeds: Sequence[int], file: Path) -> list[Row]:
    """Return how soon each mutant is found, and on how many of them chance needs five times as long."""
    hits, rows, quicker = Hits(file), list[Row](), 0
    for name in MUTANTS:
        evolved = [hits.first(name, "evolution", seed, trials) for seed in seeds]
        cap = enough(evolved, trials)
        drawn = by_chance(hits, name, seeds, cap)
        found = len(evolved) - evolved.count(None)
        sooner = median(evolved, trials) <= SHARE * at_least(drawn, cap)
        quicker += sooner
        told = (
            f"{found} of {len(seeds)} seeds, median {spread(evolved, trials)}; at random {spread(drawn, cap)}: "
            f"{'at most a fifth' if sooner else 'more than a fifth, as far as is known'}"
        )
        rows.append(
            Row(
                f"mutant {name} found within {trials:,} trials",
                told,
                "9 of 10 seeds",
                found >= 0.9 * len(seeds),
            )
        )
    half = len(MUTANTS) / 2
    rows.append(Row("mutants on which a fifth of the trials is enough", f"{quicker}", "half", quicker >= half))
    return rows


def crossing(seeds: Sequence[int]) -> list[Row]:
    """Return how soon mutants are found on the one crossing of `junction`, by evolution and by chance."""
    rows, world = list[Row](), load_config(WORLD).to_document()
    for name in AT_CROSSING:
        hits = {
            strategy: [first(name, strategy, seed, MOST_THERE, world) for seed in seeds]
            for strategy in ("evolution", "uniform")
        }
        evolved, drawn = (median(hits[strategy], MOST_THERE) for strategy in ("evolution", "uniform"))
        told = f"median {spread(hits['evolution'], MOST_THERE)}; at random {spread(hits['uniform'], MOST_THERE)}"
        rows.append(Row(f"{name} on {WORLD}, of {len(seeds)} seeds", told, "<= at random", evolved <= drawn))
    return rows


def by_chance(hits: Hits, name: str, seeds: Sequence[int], cap: int) -> list[int | None]:
    """Return how soon chance finds a mutant, until so many seeds are given up that the median is above `cap`."""
    drawn: list[int | None] = []
    for seed in seeds:
        drawn.append(hits.first(name, "uniform", seed, cap))
        if drawn.count(None) > len(seeds) // 2:
            break
    return drawn


def enough(evolved: Sequence[int | None], trials: int) -> int:
    """Return how many trials chance must do without a breach for the evolution to need at most a fifth of them."""
    return math.ceil(median(evolved, trials) / SHARE)


def at_least(counts: Sequence[int | None], most: int) -> float:
    """Return what the median of counts is at least, if None stands for any number above `most`."""
    return statistics.median([most + 1 if count is None else count for count in counts])


def median(counts: Sequence[int | None], most: int) -> float:
    """Return the median of counts, of which None stands for 2 * `most`: nearly all searches find something."""
    return statistics.median([2 * most if count is None else count for count in counts])


def spread(counts: Sequence[int | None], most: int) -> str:
    """Return the median of counts, the least and the most, in words; None stands for any number above `most`."""
    known = sorted(count for count in counts if count is not None)
    if len(known) == len(counts):
        return f"{statistics.median(known):,.0f} ({known[0]:,} to {known[-1]:,})"
    exact = len(known) > len(counts) // 2
    middle = f"{at_least(counts, most):,.0f}" if exact else f"more than {at_least(counts, most) - 1:,.0f}"
    least = f"; the least {known[0]:,}" if known else ""
    return f"{middle} ({len(counts) - len(known)} of {len(counts)} given up after {most:,}{least})"


class _Watched(LocalRunner):
    """Runs trials here, and keeps them."""

    seen: list[Instance]

    def run(self, instances: Sequence[Instance]) -> Iterator[dict[int, Tried]]:
        """Run the trials of instances."""
        self.seen += instances
        return super().run(instances)


def overheads() -> list[Row]:
    """Return what searches take over plain batches, on the crossing and in the town."""
    return [overhead(load_config(WORLD), WORLD), overhead(Configuration.from_document(TOWN), "the town")]


def overhead(world: Configuration, name: str, trials: int = 32 * GENERATION, rounds: int = 3) -> Row:
    """Return what a search of `rules` takes over a plain batch of the same trials, in seconds of a processor.

    Search and batch take turns, `rounds` times, and of each the least counts. Each has roads of its own, on which
    nothing has been worked out yet; making the trials is the search's to do.
    """
    searched, plain = zip(*[_taken(world, trials) for _ in range(1 + rounds)][1:], strict=True)
    more = min(searched) / min(plain) - 1.0
    told = f"{1e3 * min(searched) / trials:.2f} ms a trial, {more:.0%} over {1e3 * min(plain) / trials:.2f} ms"
    return Row(f"search of rules in {name}, {trials:,} trials of 15 s", told, f"<= {OVERHEAD:.0%}", more <= OVERHEAD)


def _taken(world: Configuration, trials: int) -> tuple[float, float]:
    """Return the seconds that a search takes, and a plain batch of its trials."""
    crew = _Watched("rules", "rules")
    crew.seen = []

    @contextmanager
    def watched(*_: object) -> Iterator[LocalRunner]:
        yield crew

    real = search.runner_of
    search.runner_of = watched  # pyright: ignore[reportAttributeAccessIssue]  # the search is timed with a crew that watches
    try:
        with tempfile.TemporaryDirectory() as folder:
            began = time.process_time()
            falsify(_anew(world), "rules", Path(folder) / "found", trials=trials, seed=2)
            searched = time.process_time() - began
    finally:
        search.runner_of = real
    roads = draw(_anew(world)).problem.network
    own = [replace(one, problem=replace(one.problem, network=roads)) for one in crew.seen]
    crew.seen.clear()
    began = time.process_time()
    for first_one in range(0, trials, GENERATION):
        list(outcomes(own[first_one : first_one + GENERATION], "rules", batch=GENERATION))
    return searched, time.process_time() - began


def _anew(world: Configuration) -> Configuration:
    """Return a configuration that is read again."""
    return Configuration.from_document(world.to_document())


def drivers(trials: int, folder: Path) -> list[Row]:
    """Return what searches find in `rules` and `lanes+shield`, and how seldom `rules` fails at random."""
    rows: list[Row] = []
    for name in ("rules", "lanes+shield"):
        found = _searched(name, "evolution", trials, folder)
        rows.append(Row(f"{name}, {trials:,} searched trials: broke a rule in", _told(found), "0", not found.violated))
    found = _searched("rules", "uniform", trials, folder)
    low, high = clopper_pearson(found.violated, found.trials)
    told = f"{_told(found)}; 95 % interval {low:.1e} to {high:.1e}"
    rows.append(Row(f"rules, {trials:,} trials at random: broke a rule in", told, "0", not found.violated))
    return rows


def _searched(controller: str, strategy: str, trials: int, folder: Path) -> Found:
    """Return what a search finds that goes on where an earlier one of the same code was interrupted."""
    place = folder / f"falsify-{code_of_searches()}" / f"{controller}-{strategy}"
    return falsify(WORLD, controller, place, trials=trials, seed=1, strategy=strategy, resume=place.exists())


def _told(found: Found) -> str:
    return f"{found.violated} ({', '.join(found.cases) or 'nothing'}); {found.discarded} discarded"


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="experiments.falsify")
    for name, usual in (("trials", TRIALS), ("seeds", SEEDS), ("long", LONG)):
        parser.add_argument(name, type=int, nargs="?", default=usual)
    parser.add_argument("--rows", type=Path, default=ROWS)
    parser.add_argument("--begin", type=int, default=BEGIN)
    parser.add_argument("--crossing", action="store_true", help="only the searches on one crossing: minutes")
    return parser.parse_args()


if __name__ == "__main__":
    given = _arguments()
    found = (
        crossing(range(given.begin, given.begin + given.seeds))
        if given.crossing
        else measure(given.trials, given.seeds, given.long, given.rows, given.begin)
    )
    raise SystemExit(not show("falsify", found))
