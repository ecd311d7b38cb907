"""`python -m benchmarks.service [SECONDS]`: pages for 50 readers while two workers judge, on SQLite; the fair queue.

A reader opens a page, reads for about a second, and opens the next. `a page without a pause` is how many pages a second
the server can give to readers that never pause. Then a season is held (`benchmarks.season`), which takes an hour.
"""

from __future__ import annotations

import asyncio
import itertools
import random
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import httpx
import numpy as np
from tests.services import CIRCLING, STANDING, Person, Service, competition_text, serving

from benchmarks import season
from benchmarks.season import processor_s
from benchmarks.table import Row, show
from dubins_traffic.competition.competition import Quota
from dubins_traffic.service import accounts, queue, submissions
from dubins_traffic.service.database import Database
from dubins_traffic.service.database_tables import Account, Competition, Phase
from dubins_traffic.service.submissions import Upload

READERS = 50
SECONDS = 20.0
MOST_S = 0.150
"""The 95th percentile of pages, seconds."""
QUEUED = 100
"""Submissions that one team queues before another hands in its first."""


async def read(client: httpx.AsyncClient, paths: Sequence[str], until: float, pause: float) -> list[float]:
    """Read pages as a reader does until a time; return how long each took."""
    took: list[float] = []
    await asyncio.sleep(random.random() * pause)
    while time.perf_counter() < until:
        began = time.perf_counter()
        answer = await client.get(random.choice(paths))
        answer.raise_for_status()
        took.append(time.perf_counter() - began)
        await asyncio.sleep(pause * (0.5 + random.random()))
    return took


async def all_read(url: str, cookies: httpx.Cookies, paths: Sequence[str], seconds: float, pause: float) -> list[float]:
    """Let all readers read at a time, each by a connection of its own."""
    limits = httpx.Limits(max_connections=READERS, max_keepalive_connections=READERS)
    async with httpx.AsyncClient(base_url=url, cookies=cookies, timeout=60, limits=limits, verify=False) as client:
        until = time.perf_counter() + seconds
        found = await asyncio.gather(*(read(client, paths, until, pause) for _ in range(READERS)))
    return list(itertools.chain.from_iterable(found))


def busy(service: Service) -> tuple[Person, list[str]]:
    """Fill the queue, and return somebody and the pages to read."""
    organiser = service.organiser()
    people = [service.person().join(organiser.invite(), f"p{k}", f"t{k}") for k in range(3)]
    first = people[0].submit("short/practice", STANDING)
    people[0].ended(first)
    for person, k in itertools.product(people, range(5)):
        person.submit("short/practice", f"{CIRCLING}\n# {k}")
    pages = ["/", "/c/short", "/c/short/practice", "/c/short/practice/table", "/status", f"/s/{first}"]
    return people[0], [*pages, f"/s/{first}/live", f"/s/{first}/trials/0", f"/s/{first}/trials/0/replay"]


def pages(seconds: float) -> tuple[list[float], float, float]:
    """Return how long pages took for readers who read, processor time a page, and pages a second without pauses."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "short.toml").write_text(competition_text(20, duration=20))
        arguments = ("--competition", str(folder / "short.toml"), "--workers", "2", "--trust-submissions")
        with serving(folder / "here", *arguments) as service:
            person, paths = busy(service)
            cookies = person.http.cookies
            before = processor_s(service.process.pid)
            took = asyncio.run(all_read(service.url, cookies, paths, seconds, 1.0))
            each = (processor_s(service.process.pid) - before) / len(took)
            unpaused = asyncio.run(all_read(service.url, cookies, paths, seconds / 2, 0.0))
            person.post("/logout", form="/")
    return took, each, len(unpaused) / (seconds / 2)


def delay() -> int:
    """Return how many chunks of a team that queued `QUEUED` submissions come before another's first."""
    with tempfile.TemporaryDirectory() as name:
        database = Database(f"sqlite:///{name}/queue.db")
        database.migrate()
        with database.writing() as session:
            phase = Phase(name="p", shows="all", competition=Competition(slug="c", title="", document="", created=0.0))
            session.add(phase)
            for k in range(2):
                team = accounts.make_team(session, f"t{k}", 0.0)
                account = Account(name=f"a{k}", password="", role="participant", team=team, created=0.0)
                session.add(account)
                session.flush()
                for own in range(QUEUED if k == 0 else 1):
                    upload = Upload(accounts.digest_of(f"{k} {own}"), "x", 1)
                    at = 4000.0 * own
                    submissions.receive(session, phase, Quota(), account, upload, at)
                if k == 0:
                    queue.take(session, "w", 0.0, 60.0)
            chunks = [queue.take(session, "w", 0.0, 60.0) for _ in range(QUEUED)]
            found = [chunk.team_id for chunk in chunks if chunk is not None]
        database.close()
    return found.index(team.id)


def measure(seconds: float = SECONDS) -> list[Row]:
    """Measure, and compare with the bars."""
    took, each, unpaused = pages(seconds)
    late = float(np.percentile(took, 95))
    before = delay()
    return [
        Row(
            f"a page, 95th percentile, {READERS} readers",
            f"{late * 1e3:.0f} ms",
            f"at most {MOST_S * 1e3:.0f} ms",
            late <= MOST_S,
        ),
        Row("a page, median", f"{float(np.median(took)) * 1e3:.0f} ms", "no bar", True),
        Row("processor time of the server a page", f"{each * 1e3:.1f} ms", "no bar", True),
        Row("pages without a pause", f"{unpaused:.0f} a second", "no bar", True),
        Row(f"chunks before another's first, {QUEUED} queued", str(before), "at most 1", before <= 1),
        *season.measure(),
    ]


if __name__ == "__main__":
    sys.exit(0 if show("service", measure(float(sys.argv[1]) if len(sys.argv) > 1 else SECONDS)) else 1)
