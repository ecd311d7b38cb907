"""Workers that a real Ray cluster of several nodes carries: actors and a node are killed, and all is counted once."""

from __future__ import annotations

import os
import signal
import time
from contextlib import suppress
from pathlib import Path

import pytest
from sqlalchemy import func, select

from dubins_traffic.cli.main import main
from dubins_traffic.service.client import TOKEN
from dubins_traffic.service.database_tables import Chunk
from tests import ray_cluster
from tests.seasons import FAULTS, SETTINGS, TRIALS, counted_once, database_of, launched
from tests.services import STANDING, season, shown_secret, wait_until

pytestmark = pytest.mark.tools

TEAMS = max(2, FAULTS // 3)


def test_actors_and_a_node_are_killed(tmp_path: Path) -> None:
    with (
        ray_cluster.running() as cluster,
        season(tmp_path, "--workers", "0", settings=SETTINGS, trials=TRIALS) as service,
    ):
        organiser = service.organiser()
        token = shown_secret(organiser.post("/desk/worker", form="/desk", name="cluster"))
        people = [service.person().join(organiser.invite(), f"p{k}", f"t{k}") for k in range(TEAMS)]
        numbers = [person.submit("short/practice", STANDING) for person in people]
        carrier = launched(service, token, "ray", tmp_path, "--ray", cluster.address, "--workers", "2")
        for k in range(FAULTS):
            wait_until(lambda: leased(tmp_path) and cluster.actors(), pause=0.05)
            time.sleep(0.2 * (k % 3))
            killed = cluster.actors()[: 1 + k % 2]
            for process in killed:
                with suppress(ProcessLookupError):
                    os.kill(process, signal.SIGKILL)
            wait_until(lambda killed=killed: not set(killed) & set(cluster.actors()), pause=0.05)
        cluster.kill_node()
        for person, number in zip(people, numbers, strict=True):
            person.ended(number)
        left = people[0].submit("short/practice", f"{STANDING}\n# given back\n")
        wait_until(lambda: leased(tmp_path), pause=0.02)
        carrier.terminate()
        assert carrier.wait(timeout=600) == 0, (tmp_path / "ray.log").read_text()
        assert "a worker is lost" in (tmp_path / "ray.log").read_text()
        assert states_left(tmp_path) <= {"waiting"}, "no actor holds a lease any more"
        survivor = launched(service, token, "survivor", tmp_path)
        people[0].ended(left)
        survivor.terminate()
        assert survivor.wait(timeout=600) == 0
    counted_once(tmp_path, SETTINGS, TEAMS + 1)


def leased(folder: Path) -> int:
    """How many chunks are on lease to actors now."""
    database = database_of(folder, SETTINGS)
    with database.reading() as session:
        held = select(func.count()).select_from(Chunk).where(Chunk.state == "leased")
        found = session.scalar(held.where(Chunk.worker.startswith("ray ")))
    database.close()
    return found or 0


def states_left(folder: Path) -> set[str]:
    """The states of the chunks that are not done."""
    database = database_of(folder, SETTINGS)
    with database.reading() as session:
        left = set(session.scalars(select(Chunk.state).where(Chunk.state != "done")))
    database.close()
    return left


def test_no_cluster_there(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv(TOKEN, "a-token")
    assert main(["worker", "http://127.0.0.1:9", "--ray", "127.0.0.1:1"]) == 2
    assert "no Ray cluster there" in capsys.readouterr().err
    assert main(["worker", "http://127.0.0.1:9", "--workers", "2"]) == 2
    assert "--ray ADDRESS" in capsys.readouterr().err
