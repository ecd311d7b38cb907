"""What a campaign costs beside bare trials, and Ray beside the process pool.

    python -m benchmarks campaign

A short trial here is one of 10 s with 2 `lawful` e-agents and the `rules` ego on a grid of 4 by 5, two goals, all
rules judged, all scores in the table: short, but all that a trial is, and run as campaigns run their trials. (Trials of
a few ticks are all start and no drive; the first rows show what is left of a campaign's cost with those.)

Both engines have 2 workers, and each runs 20,000 short trials several times, in turn with the other, into a new
folder each time. A rate is of the time from the first chunk handed out until the table is written, on workers that
have all worked before: starting them is measured apart, as whole campaigns from beginning to end, cluster and all. The
best round of each counts. The least that a campaign can add to a trial shows with trials of a tenth of a second without
e-agents, driven by `simple` on a grid of 2 by 2, beside `run_trials` in this process.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.batch import configuration
from benchmarks.table import Row
from dubins_traffic.campaign import folder as folders
from dubins_traffic.campaign.campaign import Campaign
from dubins_traffic.campaign.ray_crew import crew_at
from dubins_traffic.campaign.run_campaign import run_campaign, run_left
from dubins_traffic.runs.crew import Crew
from dubins_traffic.runs.jobs import Job, run_trials

TRIALS = 20_000
BARE = 2_000
WORKERS = 2
ROUNDS = 5
TICKS: Mapping[str, Any] = {
    "version": 1,
    "problem_domain": "dubins_traffic",
    "network": {"grid": {"rows": 2, "columns": 2}},
    "duration": 0.1,
}


def campaign(controller: str, document: Mapping[str, Any], trials: int) -> Campaign:
    """Return the campaign of so many trials of a configuration with one controller."""
    configurations = [{"name": "short", "document": document}]
    return Campaign.from_document(
        {"version": 0, "controllers": [controller], "configurations": configurations, "trials": trials}
    )


def short() -> Campaign:
    """Return the campaign of short trials."""
    return campaign("rules", configuration(agents=2, duration=10), TRIALS)


@dataclass(frozen=True, slots=True)
class Whole:
    """A campaign that was run: seconds in all, trials a second after the first chunk, the table's bytes."""

    seconds: float
    rate: float
    table: bytes


def whole(own: Campaign, **engine: Any) -> Whole:
    """Run a campaign from beginning to end; starting the workers and the table are part of the time."""
    begun = time.perf_counter()
    first: list[tuple[float, int]] = []

    def note(done: int, _total: int) -> None:
        if done and not first:
            first.append((time.perf_counter(), done))

    with tempfile.TemporaryDirectory() as folder:
        ran = run_campaign(own, Path(folder) / "out", progress=note, **engine)
        ended = time.perf_counter()
        table = (ran.folder / "results.parquet").read_bytes()
    since, done = first[0]
    return Whole(ended - begun, (own.total - done) / (ended - since), table)


def at_work(own: Campaign, engine: Crew) -> float:
    """Return the seconds that a campaign takes on workers that have worked before, the table included."""
    with (
        tempfile.TemporaryDirectory() as place,
        folders.opened(Path(place) / "out", own, resume=False, records=None) as folder,
    ):
        begun = time.perf_counter()
        run_left(folder, engine)
        folder.finish()
        return time.perf_counter() - begun


def measure() -> list[Row]:
    """Measure, and return the rows of the table."""
    own = short()
    whole(own, workers=WORKERS)
    both = [whole(own, workers=WORKERS), whole(own, workers=WORKERS, ray="local")]
    with closing(crew_at(None, WORKERS)) as pool, closing(crew_at("local", WORKERS)) as ray:
        for engine in (pool, ray):
            at_work(own, engine)
        rounds = [(at_work(own, pool), at_work(own, ray)) for _ in range(ROUNDS)]
    in_pool, on_ray = (min(one[k] for one in rounds) for k in (0, 1))
    slower = on_ray / in_pool - 1.0
    same = both[0].table == both[1].table
    return [
        *overhead(),
        Row(f"process pool, {WORKERS} workers at work", f"{TRIALS / in_pool:,.0f} trials/s", "", True),
        Row(f"Ray, {WORKERS} workers at work", f"{TRIALS / on_ray:,.0f} trials/s", "", True),
        Row("more time on Ray than in the pool", f"{slower:+.1%}", "<= 15 %", slower <= 0.15),
        Row(
            "whole campaigns, with starting and ending the workers: pool, Ray",
            f"{both[0].seconds:.1f} s, {both[1].seconds:.1f} s, {both[1].seconds / both[0].seconds:.2f} times",
            "",
            True,
        ),
        Row("the same table", "yes" if same else "no", "yes", same),
    ]


def bare(own: Campaign) -> float:
    """Return the seconds that bare trials take, one after the other."""
    cell = own.cells[0]
    jobs = [Job(k, cell.seed, "simple", configuration=cell.settled) for k in range(own.total)]
    for _ in run_trials(jobs[:10]):
        continue
    began = time.perf_counter()
    for _ in run_trials(jobs):
        continue
    return time.perf_counter() - began


def overhead() -> list[Row]:
    """Measure what a campaign adds to bare trials, and return the rows of it."""
    own = campaign("simple", TICKS, BARE)
    each = bare(own) / BARE
    single = whole(own, workers=1)
    more = 1.0 / (single.rate * each) - 1.0
    return [
        Row("a bare trial of 3 ticks", f"{1e3 * each:.3f} ms", "", True),
        Row("more time a trial in a campaign, one worker", f"{more:+.1%}", "<= 15 %", more <= 0.15),
    ]
