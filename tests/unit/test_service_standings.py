"""Which submission of a team counts, and that the podium is run a second time, once."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from sqlalchemy import select
from sqlalchemy.orm import Session

from dubins_traffic.service import accounts, housekeeping, standings, viewing
from dubins_traffic.service.database_tables import (
    Account,
    Chunk,
    Competition,
    Phase,
    Standing,
    Submission,
    Trial,
)
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
