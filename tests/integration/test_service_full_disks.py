"""Full disks: of the service, of its store alone, and of PostgreSQL: nothing is lost or counted twice."""

from __future__ import annotations

import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path

import psycopg
import pytest

from tests import postgres
from tests.disks import fill, small_disk
from tests.seasons import FAULTS, SETTINGS, TRIALS, counted_once, kept_whole, offered, sent
from tests.services import STANDING, Person, season, wait_until

pytestmark = pytest.mark.tools

DISKS = 3 if FAULTS >= 20 else 1
REPLAY_ROOM = 16 << 10
"""Bytes into which a controller of these tests fits, but no replay."""


@pytest.fixture
def open_folder() -> Iterator[Path]:
    """A folder that other users may enter."""
    with tempfile.TemporaryDirectory(prefix="disks-") as name:
        Path(name).chmod(0o755)
        yield Path(name)


def test_the_disk_of_the_service(tmp_path: Path) -> None:
    """Database, store and worker find no room: what is sent is refused, nothing is half kept, and then all goes on."""
    with small_disk(tmp_path / "here", 24 << 10) as here:
        with season(tmp_path, "--workers", "1", settings=SETTINGS, trials=TRIALS) as service:
            organiser = service.organiser()
            person = service.person().join(organiser.invite(), "Ann", "Ants").with_token()
            log, numbers = tmp_path / "here.log", list[int]()
            for number in range(DISKS):
                numbers.append(person.submit("short/practice", f"{STANDING}\n# {number}"))
                wait_until(lambda: person.state(numbers[-1]) in BEGUN, pause=0.02)
                told = len(log.read_text())
                fill(here / "ballast")
                big = f"{STANDING}\n# {number}\n" + "#" * 400_000
                assert offered(person, big).status_code == 503, log.read_text()[told:]
                assert person.api("GET", "/status").status_code == 200
                wait_until(lambda told=told: suffers(log, told) or person.state(numbers[-1]) == "done")
                (here / "ballast").unlink()
                numbers.append(sent(person, big))
                assert sent(person, big) == numbers[-1]
            for number in numbers:
                person.ended(number)
        counted_once(tmp_path, SETTINGS, 2 * DISKS)
        kept_whole(tmp_path, SETTINGS, str(here / "store"))


def suffers(log: Path, since: int) -> bool:
    """Whether a worker or the database has found no room."""
    told = log.read_text()[since:]
    return "a chunk failed" in told or "the database is away" in told


def test_the_disk_of_the_store(tmp_path: Path) -> None:
    """A worker keeps what it can't hand over, and hands it over when there is room: no trial is run a second time."""
    with small_disk(tmp_path / "disk", 8 << 10) as disk:
        settings = f'{SETTINGS}storage = "{disk / "store"}"\n'
        with season(tmp_path, "--workers", "1", settings=settings, trials=TRIALS) as service:
            organiser = service.organiser()
            person = service.person().join(organiser.invite(), "Ann", "Ants").with_token()
            log = tmp_path / "here.log"
            for number in range(DISKS):
                fill(disk / "ballast", REPLAY_ROOM)
                told = log.read_text().count("the store takes nothing")
                entry = sent(person, f"{STANDING}\n# {number}\n")
                wait_until(lambda told=told: log.read_text().count("the store takes nothing") > told, 60)
                fill(disk / "more")
                assert offered(person, STANDING + "#" * 400_000).status_code == 503
                (disk / "ballast").unlink()
                (disk / "more").unlink()
                person.ended(entry)
        counted_once(tmp_path, settings, DISKS)
        kept_whole(tmp_path, settings, str(disk / "store"))


def test_the_disk_of_postgresql(tmp_path: Path, open_folder: Path) -> None:
    """No room for tables, and none for its log, which ends PostgreSQL: reports and uploads wait for it."""
    with small_disk(open_folder / "disk", 96 << 10) as disk, postgres.cluster(disk) as cluster:
        url = cluster.url("full")
        settings = f'{SETTINGS}database = "{url}"\n'
        with season(tmp_path, "--workers", "1", settings=settings, trials=TRIALS) as service:
            organiser = service.organiser()
            person = service.person().join(organiser.invite(), "Ann", "Ants").with_token()
            numbers = [person.submit("short/practice", STANDING)]
            for number in range(DISKS):
                wait_until(lambda: person.state(numbers[-1]) in BEGUN, pause=0.02)
                fill(disk / "ballast")
                use_up(cluster, url, BY[number % len(BY)])
                sender = threading.Thread(target=persist, args=(person, f"{STANDING}\n# {number}\n", numbers))
                sender.start()
                sender.join(1.0)
                (disk / "ballast").unlink()
                cluster.revive()
                free(url)
                sender.join()
            for number in numbers:
                person.ended(number)
        counted_once(tmp_path, settings, 1 + DISKS)


BEGUN = ("running", "scoring", "done")
BY = (
    "SELECT pg_logical_emit_message(false, 'ballast', repeat('x', 500000))",
    "INSERT INTO ballast SELECT repeat('x', 1000) FROM generate_series(1, 1000)",
)
"""What fills a disk of PostgreSQL to the last page: its write-ahead log, or a table."""


def use_up(cluster: postgres.Cluster, url: str, statement: str) -> None:
    """Let PostgreSQL itself write until its disk is full."""
    full = cluster.log.read_text().count("No space left on device")
    with pytest.raises(psycopg.Error):
        write_on(url, statement)
    assert cluster.log.read_text().count("No space left on device") > full


def write_on(url: str, statement: str) -> None:
    with psycopg.connect(plain(url), autocommit=True) as connection:
        connection.execute("CREATE TABLE IF NOT EXISTS ballast (text text)")
        for _ in range(1000):
            connection.execute(statement)


def free(url: str) -> None:
    with psycopg.connect(plain(url), autocommit=True) as connection:
        connection.execute("DROP TABLE IF EXISTS ballast")


def plain(url: str) -> str:
    return url.replace("+psycopg", "")


def persist(person: Person, text: str, numbers: list[int]) -> None:
    """Hand in until it is taken, as a participant does who is told to come again."""

    def taken() -> bool:
        answer = offered(person, text)
        if answer.status_code in (200, 201):
            numbers.append(answer.json()["id"])
        return bool(answer.status_code in (200, 201))

    wait_until(taken)
