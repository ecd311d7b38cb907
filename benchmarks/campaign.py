"""What a campaign costs beside bare trials, and Ray beside the process pool.

    python -m benchmarks campaign

20,000 trials of a tenth of a second without e-agents, driven by `simple` on a grid of 2 by 2, so that what is not the
trial shows. The bare loop runs a tenth of them with `run_trials` in this process.
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.table import Row
from dubins_traffic.campaign.campaign import Campaign
from dubins_traffic.campaign.conduct import run_campaign
from dubins_traffic.campaign.many import Job, run_trials

TRIALS = 20_000
BARE = 2_000
WORKERS = 2
GRID: dict[str, Any] = {
    "version": 1,
    "problem_domain": "dubins_traffic",
    "network": {"grid": {"rows": 2, "columns": 2}},
    "duration": 0.1,
}


def campaign(trials: int) -> Campaign:
    """Return the campaign of short trials."""
    configurations = [{"name": "short", "document": GRID}]
    return Campaign.from_document(
        {"version": 0, "controllers": ["simple"], "configurations": configurations, "trials": trials}
    )


def bare(trials: int) -> float:
    """Return the seconds that bare trials take, one after the other."""
    cell = campaign(trials).cells[0]
    jobs = [Job(k, cell.seed, "simple", configuration=cell.settled) for k in range(trials)]
    for _ in run_trials(jobs[:10]):
        continue
    began = time.perf_counter()
    for _ in run_trials(jobs):
        continue
    return time.perf_counter() - began


@dataclass(frozen=True, slots=True)
class Whole:
    """A campaign that was run: seconds to the first chunk, trials a second after it, the table's bytes."""

    start: float
    rate: float
    table: bytes


def whole(trials: int, **engine: Any) -> Whole:
    """Run a campaign; the table is part of the time."""
    begun = time.perf_counter()
    first: list[tuple[float, int]] = []

    def note(done: int, _total: int) -> None:
        if done and not first:
            first.append((time.perf_counter(), done))

    with tempfile.TemporaryDirectory() as folder:
        ran = run_campaign(campaign(trials), Path(folder) / "out", progress=note, **engine)
        ended = time.perf_counter()
        table = (ran.folder / "results.parquet").read_bytes()
    since, done = first[0]
    return Whole(since - begun, (trials - done) / (ended - since), table)


def measure() -> list[Row]:
    """Measure, and return the rows of the table."""
    pool = whole(TRIALS, workers=WORKERS)
    ray = whole(TRIALS, workers=WORKERS, ray="local")
    slower = pool.rate / ray.rate - 1.0
    return [
        *overhead(),
        Row(f"process pool, {WORKERS} workers", f"{pool.rate:,.0f} trials/s", "", True),
        Row(f"Ray, {WORKERS} workers", f"{ray.rate:,.0f} trials/s", "", True),
        Row("more time on Ray than in the pool", f"{slower:+.1%}", "<= 15 %", slower <= 0.15),
        Row("until the first chunk: pool, Ray", f"{pool.start:.1f} s, {ray.start:.1f} s", "", True),
        Row("the same table", "yes" if pool.table == ray.table else "no", "yes", pool.table == ray.table),
    ]


def overhead() -> list[Row]:
    """Measure what a campaign adds to bare trials, and return the rows of it."""
    each = bare(BARE) / BARE
    single = whole(BARE, workers=1)
    more = 1.0 / (single.rate * each) - 1.0
    return [
        Row("a bare trial", f"{1e3 * each:.3f} ms", "", True),
        Row("more time a trial in a campaign, one worker", f"{more:+.1%}", "<= 15 %", more <= 0.15),
    ]
