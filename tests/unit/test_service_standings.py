"""Which submission of a team counts, and that the podium is run a second time, once."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import select
from sqlalchemy.orm import Session

from dubins_traffic.service import accounts, comparing, housekeeping, queue, standings, viewing
from dubins_traffic.service.database_tables import (
    Account,
    Chunk,
    Competition,
    Phase,
    Standing,
    Submission,
    Trial,
    Worker,
)
from dubins_traffic.service.hiding import Hiding, hiding_of
from dubins_traffic.service.service import Service

NOW = 5000.0


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    made = Service(tmp_path / "here", tmp_path / "here.key", clock=lambda: NOW)
    made.database.migrate()
    yield made
    made.close()


def phase_with(session: Session, *states: str) -> tuple[Phase, list[Submission]]:
    """Add a closed test phase, and submissions of one team in these states, each with two trials."""
    competition = Competition(slug="c", title="C", document="{}", created=0.0)
    phase = Phase(name="test", shows="nothing", opens=0.0, closes=4000.0, competition=competition)
    team = accounts.make_team(session, "t", 0.0)
    account = Account(name="a", password="none", role="participant", team=team, created=0.0)
    session.add_all([phase, account])
    session.flush()
    made: list[Submission] = []
    for k, state in enumerate(states):
        one = Submission(
            phase_id=phase.id, team_id=team.id, account_id=account.id, digest=f"{k:064}", filename="x", size=1,
            state=state, received=float(k), changed=0.0, deadline=9999.0, run=0,
        )  # fmt: skip
        session.add(one)
        session.flush()
        for number in range(2):
            own = {"submission_id": one.id, "run": 0, "number": number}
            session.add(Trial(**own, row={}, end="duration", log="", frames="f"))
        made.append(one)
    session.flush()
    return phase, made


def test_the_named_submission_counts_else_the_last_valid_one(service: Service) -> None:
    with service.database.writing() as session:
        phase, made = phase_with(session, "done", "done", "rejected", "failed", "done", "cancelled")

        def counting() -> list[int]:
            return [own.id for own in standings.counting(session, phase).values()]

        assert counting() == [made[4].id]
        made[1].named = True
        assert counting() == [made[1].id]
        made[1].disqualified = "it cheated"
        assert counting() == [made[4].id]
        made[4].disqualified = "so did this"
        assert counting() == [made[0].id]


def test_the_podium_is_run_again_once(service: Service) -> None:
    with service.database.writing() as session:
        phase, made = phase_with(session, "done", "done")
        places = [{"place": 1, "submission": made[0].id}, {"place": 4, "submission": made[1].id}]
        places.append({"place": None, "submission": made[1].id})
        session.add(Standing(phase_id=phase.id, at=1.0, version=0, places=places))
        made[0].state = "running"
    for _ in range(2):
        housekeeping.check_podiums(service)
        with service.database.writing() as session:
            assert session.scalars(select(Chunk)).all() == []
    with service.database.writing() as session:
        session.get_one(Submission, made[0].id).state = "done"
    for _ in range(2):
        housekeeping.check_podiums(service)
    with service.database.reading() as session:
        chunk = session.scalars(select(Chunk)).one()
        assert (chunk.submission_id, chunk.kind, chunk.numbers) == (made[0].id, "again", [0, 1])


def test_trials_that_differ_are_named(service: Service) -> None:
    with service.database.writing() as session:
        _, (made,) = phase_with(session, "done")
        first, second = session.scalars(select(Trial).order_by(Trial.number)).all()
        first.again, second.again = "f", "g"
        session.flush()
        assert viewing.differing(service, session, made) == [1]


def test_the_history_is_read_by_page(service: Service) -> None:
    with service.database.writing() as session:
        phase, _ = phase_with(session, "done")
        hiding = hiding_of(b"k" * 32, "c/test")
        for number in range(2000):
            made = Standing(phase_id=phase.id, at=float(number), version=number)
            hiding.keep(made, {"places": [number]})
            session.add(made)
    read: list[int] = []

    class Reading(Hiding):
        def shown(self, row: Any, *, logs: bool = False) -> Any:  # noqa: ARG002
            read.append(row.version)
            return row

    with service.database.reading() as session:
        past, older = standings.history(session, session.get_one(Phase, phase.id), Reading(None), 0)
        assert [one.version for one in past] == read == list(range(1998, 1978, -1))
        assert older
        past, older = standings.history(session, session.get_one(Phase, phase.id), Reading(None), 99)
        assert [one.version for one in past] == list(range(18, -1, -1))
        assert not older


def test_the_wait_is_told_by_what_work_took_lately(service: Service) -> None:
    with service.database.writing() as session:
        _, (one,) = phase_with(session, "queued")
        assert comparing.wait_of(session, 4, NOW) is None
        for took in (None, 1000.0, *[6.0] * comparing.LATELY):
            own = {"team_id": one.team_id, "run": 0, "kind": "trials", "numbers": [1], "state": "done"}
            session.add(Chunk(submission_id=one.id, took=took, **own))
            session.flush()
        assert comparing.wait_of(session, 4, NOW) is None
        for name, seen in (("a", NOW), ("b", NOW - 1.0), ("gone", NOW - 1000.0)):
            session.add(Worker(name=name, seen=seen))
        session.flush()
        assert comparing.wait_of(session, 4, NOW) == 4 * 6.0 / 2
        assert comparing.wait_of(session, None, NOW) is None


def test_work_that_is_done_says_how_long_it_took(service: Service) -> None:
    with service.database.writing() as session:
        _, (one,) = phase_with(session, "queued")
        queue.add(session, one, "trials", [[0, 1]])
        chunk = queue.take(session, "w", NOW, 60.0)
        assert chunk is not None
        queue.finish(session, chunk, NOW + 7.0)
        assert chunk.took == 7.0


def test_dates_are_a_line_with_now_on_it() -> None:
    rows = [Phase(name="a", opens=None, closes=200.0), Phase(name="b", opens=100.0, closes=300.0)]
    line = comparing.timeline(rows, 150.0)
    assert line["bars"]["a"][0] == 0.0
    assert line["bars"]["b"][0] < line["now"] < line["bars"]["a"][1] < line["bars"]["b"][1] < 100.0
    assert comparing.timeline([Phase(name="a", opens=None, closes=None)], 5.0)["bars"]["a"] == (0.0, 100.0)
