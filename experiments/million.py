"""A campaign of a million trials: how long it takes on two cores, and how much memory.

    python -m experiments million

1,000,000 trials of 10 s with 2 `lawful` e-agents and the `rules` ego on a grid of 4 by 5, two goals, all rules judged,
all scores in the table. Drawing and making the table are part of the time.
"""

from __future__ import annotations

import resource
import tempfile
from pathlib import Path
from time import perf_counter

from benchmarks.batch import configuration
from benchmarks.table import Row

from dubins_traffic.campaign.campaign import Campaign
from dubins_traffic.campaign.run_campaign import run_campaign

TRIALS = 1_000_000
WORKERS = 2
MINUTES = 5.0
GIBIBYTES = 2.0


def measure(trials: int = TRIALS) -> list[Row]:
    """Return the rows of this experiment."""
    configurations = [{"name": "million", "document": configuration(agents=2, duration=10)}]
    campaign = Campaign.from_document(
        {"version": 0, "controllers": ["rules"], "configurations": configurations, "trials": trials}
    )
    began = perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        ran = run_campaign(campaign, Path(folder) / "out", workers=WORKERS)
        table = (ran.folder / "results.parquet").stat().st_size
    minutes = (perf_counter() - began) / 60.0
    own, worker = (resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    memory = (own + WORKERS * worker) / 2**20
    rate = f"{trials / (60.0 * minutes):,.0f} trials/s"
    return [
        Row(f"{trials:,} trials", f"{minutes:.1f} min, {rate}", f"<= {MINUTES:g} min", minutes <= MINUTES),
        Row(
            "memory, the largest of each process together",
            f"{memory:.2f} GiB",
            f"<= {GIBIBYTES:g} GiB",
            memory <= GIBIBYTES,
        ),
        Row("the table", f"{table / 1e6:.0f} MB", "", True),
    ]
