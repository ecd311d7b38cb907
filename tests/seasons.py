"""Short seasons that faults happen to: served in a process, with workers as on other machines, counted afterwards."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import httpx
from obstore.store import LocalStore, from_url
from sqlalchemy import func, select

from dubins_traffic.service.client import TOKEN
from dubins_traffic.service.database import Database
from dubins_traffic.service.database_tables import Chunk, Submission, Trial
from dubins_traffic.service.storage import Storage
from tests.services import Person, Service

FAULTS = int(os.environ.get("DUBINS_TRAFFIC_FAULTS", "3"))
TRIALS = 4
SETTINGS = "lease = 2.0\nlogins = 10000\n"
SUBMISSIONS = "/competitions/short/phases/practice/submissions"


def database_of(folder: Path, settings: str) -> Database:
    url = settings.partition('database = "')[2].partition('"')[0]
    return Database(url or f"sqlite:///{folder / 'here' / 'service.db'}")


def counted_once(folder: Path, settings: str, submissions: int, runs: int | None = None) -> None:
    """Every trial of every run has exactly one result, and nothing is left in the queue; a submission has one run."""
    trials = TRIALS * (runs or submissions)
    database = database_of(folder, settings)
    with database.reading() as session:
        assert session.scalars(select(Submission.state)).all() == ["done"] * submissions
        assert session.scalar(select(func.count()).select_from(Trial)) == trials
        numbers = session.execute(select(Trial.submission_id, Trial.run, Trial.number)).all()
        assert len({tuple(one) for one in numbers}) == trials
        assert set(session.scalars(select(Chunk.state))) == {"done"}
    database.close()


def kept_whole(folder: Path, settings: str, place: str) -> None:
    """What is in the store is what it is called, all replays are there, and no lease has ended without a result."""
    database, storage = database_of(folder, settings), Storage(place)
    with database.reading() as session:
        assert set(session.scalars(select(Chunk.attempts))) == {1}
        replays = session.scalars(select(Trial.replay)).all()
    database.close()
    assert None not in replays
    kept = from_url(place) if "://" in place else LocalStore(place)
    names = [own["path"] for some in kept.list() for own in some]
    for name in names:
        kind, _, digest = name.rpartition("/")
        storage.get(digest, kind.partition("/")[0])
    assert {name.rpartition("/")[2] for name in names if name.startswith("replays")} == set(replays)


def launched(service: Service, token: str, name: str, folder: Path, *arguments: str) -> subprocess.Popen[bytes]:
    """Start a worker as one on another machine would be."""
    command = [sys.executable, "-m", "dubins_traffic.cli", "worker", service.url, "--name", name]
    command += ["--folder", str(folder / name), "--trust-submissions", *arguments]
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


def offered(person: Person, text: str) -> httpx.Response:
    """Hand in a controller by the API, and return the answer."""
    return person.api("POST", SUBMISSIONS, files={"file": ("controller.py", text.encode())})


def sent(person: Person, text: str) -> int:
    """Hand in a controller by the API, and return its number."""
    return offered(person, text).json()["id"]
