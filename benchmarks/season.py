"""`python -m benchmarks.season [SUBMISSIONS TEAMS TRIALS WORKERS]`: a whole season, on PostgreSQL and a store of S3.

Teams hand in as many submissions as are wanted, workers beside the server judge them, and meanwhile a reader asks for
tables and for the page of health in turn. What a worker costs the server, in processor time for each
second of work, says for how many workers it is enough.
"""

from __future__ import annotations

import os
import sys
import tempfile
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from unittest import mock

import httpx
import numpy as np
from tests import postgres, s3
from tests.services import STANDING, Person, Service, season, wait_until

from benchmarks.table import Row, show

SUBMISSIONS, TEAMS, TRIALS, WORKERS = 1000, 50, 20, 8
MOST = 3.0
"""The 95th percentile of tables, in units of that of the page of health."""
TABLE, HEALTH = "/c/short/practice/table", "/api/status"
MANY = 100
"""Workers of which the server's part is told."""


class Reader(threading.Thread):
    """Asks for a table and for the page of health in turn, until told to stop; keeps how long each took."""

    def __init__(self, url: str) -> None:
        super().__init__(daemon=True)
        self.took: Mapping[str, list[float]] = {TABLE: [], HEALTH: []}
        self._url, self._ended = url, threading.Event()

    def run(self) -> None:
        """Ask."""
        with httpx.Client(base_url=self._url, timeout=600) as client:
            while not self._ended.is_set():
                for path, took in self.took.items():
                    began = time.perf_counter()
                    client.get(path).raise_for_status()
                    took.append(time.perf_counter() - began)
                self._ended.wait(0.05)

    def stop(self) -> None:
        """End after the present page."""
        self._ended.set()
        self.join()

    def late(self, path: str) -> float:
        """Return the 95th percentile of a page, seconds."""
        return float(np.percentile(self.took[path], 95))


def processor_s(process: int) -> float:
    """Return the processor time of a process so far, without that of its children."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def handed_in(people: list[Person], submissions: int) -> None:
    """Let the teams hand in, one submission each in turn."""
    for number in range(submissions):
        people[number % len(people)].submit("short/practice", f"{STANDING}\n# {number}\n")


def judged(service: Service, submissions: int, teams: int, trials: int) -> tuple[Reader, float, float]:
    """Return what a reader waited while a season was judged, its seconds, and the server's processor time in it."""
    organiser = service.organiser()
    people = [service.person().join(organiser.invite(), f"p{k}", f"t{k}").with_token() for k in range(teams)]
    before, began = processor_s(service.process.pid), time.perf_counter()
    reader = Reader(service.url)
    reader.start()
    handed_in(people, submissions)

    def ended() -> bool:
        numbers = [
            one["state"]
            for person in people
            for one in person.api("GET", "/competitions/short/phases/practice/submissions").json()
        ]
        return len(numbers) == submissions and set(numbers) == {"done"}

    wait_until(ended, seconds=6.0 * submissions * trials, pause=5.0)
    took = time.perf_counter() - began
    reader.stop()
    return reader, took, processor_s(service.process.pid) - before


def measure(
    submissions: int = SUBMISSIONS, teams: int = TEAMS, trials: int = TRIALS, workers: int = WORKERS
) -> list[Row]:
    """Hold a season, and compare with the bar."""
    with (
        tempfile.TemporaryDirectory() as name,
        postgres.cluster() as cluster,
        s3.store(Path(name) / "s3") as store,
        mock.patch.dict(os.environ, store.environment()),
    ):
        settings = (
            f'database = "{cluster.url("season")}"\nstorage = "s3://{s3.BUCKET}/here"\nlogins = 100000\n'
        )
        with season(Path(name), "--workers", str(workers), settings=settings, trials=trials) as service:
            reader, took, used = judged(service, submissions, teams, trials)
    table, health = reader.late(TABLE), reader.late(HEALTH)
    share = used / took / workers
    what = f"{submissions:,} submissions of {trials} trials by {teams} teams, {workers} workers"
    return [
        Row(
            f"{what}: a table, 95th percentile, in units of the page of health",
            f"{table / health:.1f} ({table * 1e3:.0f} ms, {health * 1e3:.0f} ms)",
            f"at most {MOST:g}",
            table <= MOST * health,
        ),
        Row("trials judged a second", f"{submissions * trials / took:.1f}", "no bar", True),
        Row("processor time of the server, a second of a worker", f"{share:.3f} s", "no bar", True),
        Row(f"processors that the server would need for {MANY}", f"{MANY * share:.1f}", "no bar", True),
    ]


if __name__ == "__main__":
    sys.exit(0 if show("season", measure(*map(int, sys.argv[1:5]))) else 1)
