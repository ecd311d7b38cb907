"""Faults: workers killed with a lease, the database restarted, the server killed in uploads: nothing lost.

The suite takes a part of the counts; `DUBINS_TRAFFIC_FAULTS=20` takes 20 workers and 10 restarts.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import pytest
from sqlalchemy import select

from dubins_traffic.service.database_tables import Chunk, Submission
from tests import postgres
from tests.seasons import (
    FAULTS,
    SETTINGS,
    SUBMISSIONS,
    TRIALS,
    counted_once,
    database_of,
    launched,
    running,
    sent,
)
from tests.services import STANDING, Person, answers, season, shown_secret, wait_until

pytestmark = pytest.mark.tools

SLOW = 4
"""Submissions that are judged beside slow connections."""
NUMBERS = itertools.count()
TEAMS = max(2, FAULTS // 3)
"""So many that no chunk loses its worker so often that it is given up."""


@pytest.fixture(scope="module")
def cluster() -> Iterator[postgres.Cluster]:
    with postgres.cluster() as made:
        yield made


@pytest.fixture(params=["sqlite", "postgresql"])
def settings(request: pytest.FixtureRequest) -> str:
    if request.param == "sqlite":
        return SETTINGS
    url = request.getfixturevalue("cluster").url(f"faults{next(NUMBERS)}")
    return f'{SETTINGS}database = "{url}"\n'


def test_workers_killed_with_a_lease(tmp_path: Path, settings: str) -> None:
    with season(tmp_path, "--workers", "0", settings=settings, trials=TRIALS) as service:
        organiser = service.organiser()
        token = shown_secret(organiser.post("/desk/worker", form="/desk", name="far away"))
        people = [service.person().join(organiser.invite(), f"p{k}", f"t{k}") for k in range(TEAMS)]
        numbers = [person.submit("short/practice", STANDING) for person in people]
        for k in range(FAULTS):
            name = f"victim{k}"
            worker = launched(service, token, name, tmp_path)
            try:
                wait_until(lambda name=name: running(tmp_path, settings, name), pause=0.02)
                time.sleep(0.3 * (k % 3))
            finally:
                os.killpg(worker.pid, signal.SIGKILL)
                worker.wait()
        survivor = launched(service, token, "survivor", tmp_path)
        for person, number in zip(people, numbers, strict=True):
            person.ended(number)
        survivor.terminate()
        assert survivor.wait(timeout=600) == 0
    counted_once(tmp_path, settings, TEAMS)


def test_the_database_restarted(tmp_path: Path, cluster: postgres.Cluster) -> None:
    url = cluster.url(f"restarts{next(NUMBERS)}")
    settings = f'{SETTINGS}database = "{url}"\n'
    with season(tmp_path, "--workers", "1", settings=settings, trials=TRIALS) as service:
        organiser = service.organiser()
        person = service.person().join(organiser.invite(), "Ann", "Ants")
        number = person.submit("short/practice", STANDING)
        for k in range(FAULTS // 2):
            cluster.stop("immediate" if k % 2 else "fast")
            time.sleep(0.5)
            cluster.start()
            wait_until(lambda: person.get("/status").status_code == 200)
        person.ended(number)
    counted_once(tmp_path, settings, 1)


def test_the_server_killed_in_uploads(tmp_path: Path, settings: str) -> None:
    """What was confirmed is there afterwards, once; what was not may be sent again."""
    confirmed: dict[str, int] = {}
    with season(tmp_path, "--workers", "0", settings=settings, trials=TRIALS) as service:
        organiser = service.organiser()
        person = service.person().join(organiser.invite(), "Ann", "Ants").with_token()
        port = int(service.url.rpartition(":")[2])
        sender = threading.Thread(target=send_many, args=(person, confirmed))
        sender.start()
        wait_until(lambda: len(confirmed) >= 3, pause=0.01)
        service.kill()
        sender.join()
    assert confirmed
    with season(tmp_path, "--workers", "0", settings=settings, trials=TRIALS, port=port) as service:
        for text, number in confirmed.items():
            assert sent(person, text) == number
        everything = person.api("GET", SUBMISSIONS).json()
        assert len(everything) >= len(confirmed)
        assert len({own["digest"] for own in everything}) == len(everything)
    assert answers(service.url) is False


def test_told_to_end_it_gives_back_what_is_on_lease(tmp_path: Path) -> None:
    with season(tmp_path, "--workers", "1", settings=SETTINGS.replace("2.0", "600.0"), trials=TRIALS) as service:
        organiser = service.organiser()
        person = service.person().join(organiser.invite(), "Ann", "Ants")
        number = person.submit("short/practice", STANDING)
        wait_until(lambda: person.state(number) == "running", pause=0.02)
        service.process.terminate()
        assert service.process.wait(timeout=600) == 0
    database = database_of(tmp_path, SETTINGS)
    with database.reading() as session:
        assert "leased" not in set(session.scalars(select(Chunk.state)))
        assert session.get_one(Submission, number).state in ("running", "scoring", "done")
    database.close()


def heads(there: socket.socket, ended: threading.Event) -> None:
    """Send a head without end."""
    there.sendall(b"POST /api/lease HTTP/1.1\r\nx: ")
    drip(there, ended)


def bodies(there: socket.socket, ended: threading.Event) -> None:
    """Send a body without end."""
    there.sendall(b"POST /login HTTP/1.1\r\nhost: here\r\ncontent-length: 60000\r\n\r\nname=")
    drip(there, ended)


def readers(there: socket.socket, ended: threading.Event) -> None:
    """Ask for the largest file again and again, and read nothing of it."""
    there.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    there.setblocking(False)
    asks = b"GET /static/htmx.min.js HTTP/1.1\r\nhost: here\r\n\r\n"
    while not ended.wait(0.2):
        with contextlib.suppress(BlockingIOError):
            there.send(asks)


def drip(there: socket.socket, ended: threading.Event) -> None:
    while not ended.wait(0.2):
        there.sendall(b"a")


@pytest.mark.parametrize("dawdle", [heads, bodies, readers])
def test_slow_connections_cost_no_lease(
    tmp_path: Path, dawdle: Callable[[socket.socket, threading.Event], None]
) -> None:
    """Sixty of them send a byte again and again, or read nothing, while leases of two seconds are held."""
    with season(tmp_path, "--workers", "1", settings=SETTINGS, trials=TRIALS) as service:
        person = service.person().join(service.organiser().invite(), "Ann", "Ants").with_token()
        host, _, port = service.url.removeprefix("http://").partition(":")
        ended = threading.Event()

        def again() -> None:
            while not ended.is_set():
                with contextlib.suppress(OSError), socket.create_connection((host, int(port))) as there:
                    dawdle(there, ended)

        dawdling = [threading.Thread(target=again) for _ in range(60)]
        for thread in dawdling:
            thread.start()
        try:
            numbers = [sent(person, f"{STANDING}\n# {k}\n") for k in range(SLOW)]
            for number in numbers:
                person.ended(number)
        finally:
            ended.set()
            for thread in dawdling:
                thread.join()
    counted_once(tmp_path, SETTINGS, SLOW)
    database = database_of(tmp_path, SETTINGS)
    with database.reading() as session:
        assert set(session.scalars(select(Chunk.attempts))) == {1}
    database.close()


def send_many(person: Person, confirmed: dict[str, int]) -> None:
    """Send one thing after the other until nobody answers."""
    for k in range(50):
        text = f"{STANDING}\n# {k}\n" + "#" * 200_000
        try:
            confirmed[text] = sent(person, text)
        except (httpx.HTTPError, KeyError):
            return
