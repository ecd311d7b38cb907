"""A worker and what it reports: parts of a chunk that takes long, results whose replay nobody takes."""

from __future__ import annotations

import base64
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from sqlalchemy import select

from dubins_traffic.service import worker as room
from dubins_traffic.service.client import Connection
from dubins_traffic.service.database import Database
from dubins_traffic.service.database_tables import Chunk, Trial
from tests.services import STANDING, competition_text, serving, shown_secret

TRIALS = 3
SMALL = "logins = 10000\nlargest_upload = 1\nlargest_replay = 1\n"


@contextmanager
def working(worker: room.Worker) -> Iterator[None]:
    """Let a worker of this process work while the body runs."""
    thread = threading.Thread(target=worker.work)
    thread.start()
    try:
        yield
    finally:
        worker.stop()
        thread.join()


def test_others_come_between_and_a_result_counts_without_its_replay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(room, "LONGEST_S", 0.0)
    monkeypatch.setattr(room, "replay_of", lambda _: base64.b64encode(os.urandom(3 << 20)).decode())
    (tmp_path / "short.toml").write_text(competition_text(TRIALS))
    arguments = ("--competition", str(tmp_path / "short.toml"), "--workers", "0")
    with serving(tmp_path / "here", *arguments, settings=SMALL) as service:
        organiser = service.organiser()
        person = service.person().join(organiser.invite(), "Ann", "Ants")
        token = shown_secret(organiser.post("/desk/worker", form="/desk", name="far away"))
        number = person.submit("short/practice", STANDING)
        worker = room.Worker(Connection(service.url, token), "far away", tmp_path / "work", trust=True)
        with working(worker):
            person.ended(number)
        assert person.get(f"/s/{number}/trials/0").status_code == 200
        assert person.get(f"/s/{number}/trials/0/replay").status_code == 404
    database = Database(f"sqlite:///{tmp_path / 'here' / 'service.db'}")
    with database.reading() as session:
        parts = [(chunk.kind, chunk.numbers, chunk.attempts) for chunk in session.scalars(select(Chunk))]
        assert parts[:-1] == [("check", [], 1), *(("trials", [k], 1) for k in range(TRIALS))]
        assert parts[-1][0] == "again"
        assert set(session.scalars(select(Trial.replay))) == {None}
    database.close()
