"""Faults: workers killed with a lease, the database restarted, full disks, the server killed in uploads: nothing lost.

The suite takes a part of the counts; `DUBINS_TRAFFIC_FAULTS=20` takes 20 workers, 10 restarts and 3 full disks.
"""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
import pytest
from sqlalchemy import func, select

from dubins_traffic.service.connection import TOKEN
from dubins_traffic.service.database import Database
from dubins_traffic.service.tables import Chunk, Submission, Trial
from tests import postgres
from tests.services import (
    STANDING,
    Person,
    Service,
    answers,
    competition_text,
    serving,
    shown_secret,
    wait_until,
)

FAULTS = int(os.environ.get("DUBINS_TRAFFIC_FAULTS", "3"))
NUMBERS = itertools.count()
TRIALS = 4
TEAMS = max(2, FAULTS // 3)
"""So many that no chunk loses its worker so often that it is given up."""
SETTINGS = "lease = 2.0\nlogins = 10000\n"


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


@contextmanager
def season(folder: Path, settings: str, *arguments: str, port: int = 0) -> Iterator[Service]:
    """Serve a competition whose phases have `TRIALS` trials."""
    folder.mkdir(exist_ok=True)
    (folder / "short.toml").write_text(competition_text(TRIALS))
    made = ("--competition", str(folder / "short.toml"), "--trust-submissions", *arguments)
    with serving(folder / "here", *made, settings=settings, port=port) as service:
        yield service


def database_of(folder: Path, settings: str) -> Database:
    url = settings.partition('database = "')[2].partition('"')[0]
    return Database(url or f"sqlite:///{folder / 'here' / 'service.db'}")


def counted_once(folder: Path, settings: str, submissions: int) -> None:
    """Every trial of every submission has exactly one result, and nothing is left in the queue."""
    database = database_of(folder, settings)
    with database.reading() as session:
        assert session.scalars(select(Submission.state)).all() == ["done"] * submissions
        assert session.scalar(select(func.count()).select_from(Trial)) == TRIALS * submissions
        numbers = session.execute(select(Trial.submission_id, Trial.number)).all()
        assert len({tuple(one) for one in numbers}) == TRIALS * submissions
        assert set(session.scalars(select(Chunk.state))) == {"done"}
    database.close()


def launched(service: Service, token: str, name: str, folder: Path) -> subprocess.Popen[bytes]:
    """Start a worker as one on another machine would be."""
    command = [sys.executable, "-m", "dubins_traffic.cli", "worker", service.url, "--name", name]
    command += ["--folder", str(folder / name), "--trust-submissions"]
    with (folder / f"{name}.log").open("wb") as log:
        return subprocess.Popen(command, env={**os.environ, TOKEN: token}, stderr=log, start_new_session=True)


def running(folder: Path, settings: str, name: str) -> bool:
    """Whether a worker holds a lease now."""
    database = database_of(folder, settings)
    with database.reading() as session:
        found = session.scalar(
            select(func.count()).select_from(Chunk).where(Chunk.state == "leased", Chunk.worker == name)
        )
    database.close()
    return bool(found)


def test_workers_killed_with_a_lease(tmp_path: Path, settings: str) -> None:
    with season(tmp_path, settings, "--workers", "0") as service:
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
        assert survivor.wait(timeout=60) == 0
    counted_once(tmp_path, settings, TEAMS)


def test_the_database_restarted(tmp_path: Path, cluster: postgres.Cluster) -> None:
    url = cluster.url(f"restarts{next(NUMBERS)}")
    settings = f'{SETTINGS}database = "{url}"\n'
    with season(tmp_path, settings, "--workers", "1") as service:
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
    with season(tmp_path, settings, "--workers", "0") as service:
        organiser = service.organiser()
        person = service.person().join(organiser.invite(), "Ann", "Ants").with_token()
        port = int(service.url.rpartition(":")[2])
        sender = threading.Thread(target=send_many, args=(person, confirmed))
        sender.start()
        wait_until(lambda: len(confirmed) >= 3, pause=0.01)
        service.kill()
        sender.join()
    assert confirmed
    with season(tmp_path, settings, "--workers", "0", port=port) as service:
        for text, number in confirmed.items():
            assert sent(person, text) == number
        everything = person.api("GET", "/competitions/short/phases/practice/submissions").json()
        assert len(everything) >= len(confirmed)
        assert len({own["digest"] for own in everything}) == len(everything)
    assert answers(service.url) is False


def test_told_to_end_it_gives_back_what_is_on_lease(tmp_path: Path) -> None:
    with season(tmp_path, SETTINGS.replace("2.0", "600.0"), "--workers", "1") as service:
        organiser = service.organiser()
        person = service.person().join(organiser.invite(), "Ann", "Ants")
        number = person.submit("short/practice", STANDING)
        wait_until(lambda: person.state(number) == "running", pause=0.02)
        service.process.terminate()
        assert service.process.wait(timeout=60) == 0
    database = database_of(tmp_path, SETTINGS)
    with database.reading() as session:
        assert "leased" not in set(session.scalars(select(Chunk.state)))
        assert session.get_one(Submission, number).state in ("running", "scoring", "done")
    database.close()


def send_many(person: Person, confirmed: dict[str, int]) -> None:
    """Send one thing after the other until nobody answers."""
    for k in range(50):
        text = f"{STANDING}\n# {k}\n" + "#" * 200_000
        try:
            confirmed[text] = sent(person, text)
        except (httpx.HTTPError, KeyError):
            return


def sent(person: Person, text: str) -> int:
    files = {"file": ("controller.py", text.encode())}
    return person.api("POST", "/competitions/short/phases/practice/submissions", files=files).json()["id"]


@pytest.mark.skipif(os.geteuid() != 0, reason="a small disk of its own needs root")
def test_a_full_disk(tmp_path: Path) -> None:
    """An upload that finds no room is refused, nothing is half kept, and all goes on when there is room."""
    here = tmp_path / "disk"
    here.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=8m", "tmpfs", str(here)], capture_output=True, check=False
    )
    if mounted.returncode:
        pytest.skip("this machine allows no mount: a full disk can't be shown")
    try:
        with season(here, SETTINGS, "--workers", "0") as service:
            organiser = service.organiser()
            person = service.person().join(organiser.invite(), "Ann", "Ants").with_token()
            for round_ in range(3):
                ballast = here / "ballast"
                fill(ballast)
                big = f"{STANDING}\n# {round_}\n" + "#" * 400_000
                files = {"file": ("controller.py", big.encode())}
                answer = person.api("POST", "/competitions/short/phases/practice/submissions", files=files)
                assert answer.status_code == 503, (here / "here.log").read_text()[-3000:]
                assert person.api("GET", "/status").status_code == 200
                ballast.unlink()
                number = sent(person, big)
                assert sent(person, big) == number
            assert len(person.api("GET", "/competitions/short/phases/practice/submissions").json()) == 3
    finally:
        subprocess.run(["umount", "-l", str(here)], check=True)


def fill(ballast: Path) -> None:
    """Write until nothing more goes onto the disk."""
    with ballast.open("wb", buffering=0) as file:
        while True:
            try:
                file.write(b"\0" * 4096)
            except OSError:
                return
