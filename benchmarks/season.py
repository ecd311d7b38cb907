"""`python -m benchmarks.season [SUBMISSIONS TEAMS TRIALS WORKERS]`: a whole season, on PostgreSQL and a store of S3.

Teams hand in as many submissions as are wanted, workers beside the server judge them, and meanwhile a reader asks for
tables and for the page of health in turn. What a worker costs the server, in processor time for each second of the
processors that workers and their boxes use, says for how many workers it is enough. Trials are short: longer ones cost
less.
"""

from __future__ import annotations

import os
import sys
import tempfile
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
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


def processor_s(process: int, *, children: bool = False) -> float:
    """Return the processor time of a process so far, without or with that of its children that have ended."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return sum(map(int, fields[11 : 15 if children else 13])) / os.sysconf("SC_CLK_TCK")


def workers_s(service: Service) -> float:
    """Return the processor time of the workers of a service so far, with that of the boxes that have ended."""
    server = service.process.pid
    found = Path(f"/proc/{server}/task").glob("*/children")
    return sum(processor_s(int(pid), children=True) for path in found for pid in path.read_text().split())


def handed_in(people: list[Person], submissions: int) -> None:
    """Let the teams hand in, one submission each in turn."""
    for number in range(submissions):
        people[number % len(people)].submit("short/practice", f"{STANDING}\n# {number}\n")


@dataclass(frozen=True, slots=True)
class Held:
    """A season that was held: what a reader waited, its seconds, and the processor time of server and workers."""

    reader: Reader
    took: float
    server: float
    workers: float


def held(service: Service, submissions: int, teams: int, trials: int) -> Held:
    """Hold a season: teams hand in, and wait until all is judged."""
    organiser = service.organiser()
    people = [service.person().join(organiser.invite(), f"p{k}", f"t{k}").with_token() for k in range(teams)]
    before, before_workers, began = processor_s(service.process.pid), workers_s(service), time.perf_counter()
    reader = Reader(service.url)
    reader.start()
    handed_in(people, submissions)

    def ended() -> bool:
        state = httpx.get(f"{service.url}/api/status", timeout=60).json()
        if state["waiting"] or state["running"]:
            return False
        states = [
            one["state"]
            for person in people
            for one in person.api("GET", "/competitions/short/phases/practice/submissions").json()
        ]
        return len(states) == submissions and set(states) == {"done"}

    wait_until(ended, seconds=6.0 * submissions * trials, pause=5.0)
    took = time.perf_counter() - began
    reader.stop()
    return Held(reader, took, processor_s(service.process.pid) - before, workers_s(service) - before_workers)


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
        settings = f'database = "{cluster.url("season")}"\nstorage = "s3://{s3.BUCKET}/here"\nlogins = 100000\n'
        with season(Path(name), "--workers", str(workers), settings=settings, trials=trials) as service:
            found = held(service, submissions, teams, trials)
    table, health = found.reader.late(TABLE), found.reader.late(HEALTH)
    share, count = found.server / found.workers, submissions * trials
    what = f"{submissions:,} submissions of {trials} trials by {teams} teams, {workers} workers"
    return [
        Row(
            f"{what}: a table, 95th percentile, in units of the page of health",
            f"{table / health:.1f} ({table * 1e3:.0f} ms, {health * 1e3:.0f} ms)",
            f"at most {MOST:g}",
            table <= MOST * health,
        ),
        Row("trials judged a second", f"{count / found.took:.1f}", "no bar", True),
        Row(
            "processor time of a trial: the server's, readers' pages and ranking with it; a worker's",
            f"{found.server / count:.3f} s; {found.workers / count:.3f} s",
            "no bar",
            True,
        ),
        Row(
            f"processors that {MANY} busy ones of workers need in the server",
            f"{MANY * share:.1f}",
            "no bar",
            True,
        ),
    ]


if __name__ == "__main__":
    sys.exit(0 if show("season", measure(*map(int, sys.argv[1:5]))) else 1)
