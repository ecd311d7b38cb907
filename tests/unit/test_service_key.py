"""The key of what is secret: what needs it waits for it, all else goes on; and workers get one seed at a time."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from litestar.testing import TestClient
from sqlalchemy import select
from sqlalchemy.orm import Session

from dubins_traffic.competition.competition import Quota
from dubins_traffic.service import accounts, housekeeping, organising, queue, receiving, submissions, viewing
from dubins_traffic.service.database_tables import Account, Phase, Submission
from dubins_traffic.service.service import NoKeyError, Service
from dubins_traffic.service.serving import prepare
from dubins_traffic.service.submissions import Upload
from dubins_traffic.service.web.app import create_app
from tests.services import competition_text

NOW = 2_000_000_000.0
TRIALS = 3


class Clock:
    """A clock that a test sets."""

    at = NOW

    def __call__(self) -> float:
        return self.at


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    made = opened(tmp_path)
    made.database.migrate()
    organising.create(made, "short", {"competition.toml": competition_text(TRIALS).encode()}, None)
    with made.database.writing() as session:
        code = accounts.invite(session, accounts.PARTICIPANT, None, NOW)
    accounts.join(made.database, code, "Ann", "correct horse", "Ants", NOW)
    yield made
    made.close()


def opened(tmp_path: Path) -> Service:
    return Service(tmp_path / "here", tmp_path / "here.key", Clock())


def handed(session: Session, service: Service, phase: str) -> Submission:
    row = receiving.phase_named(session, "short", phase)
    upload = Upload(accounts.digest_of(phase), phase, 1)
    person = session.scalars(select(Account)).one()
    return submissions.receive(session, row, Quota(), person, upload, service.clock())[0]


@pytest.mark.usefixtures("service")
def test_without_the_key_submissions_are_taken_and_wait_until_it_is_there(tmp_path: Path) -> None:
    key = tmp_path / "here.key"
    key.rename(tmp_path / "elsewhere.key")
    keyless = opened(tmp_path)
    assert isinstance(keyless.clock, Clock)
    with keyless.database.writing() as session:
        waiting = keyless.waiting_for_key(session)
        assert [row.name for row in waiting] == ["validation", "test"]
        unjudged = [row.id for row in waiting]
        for phase in ("test", "practice"):
            submission = handed(session, keyless, phase)
            check = queue.take(session, "w", NOW, 60.0, unjudged)
            assert check is not None
            assert (check.kind, check.submission_id) == ("check", submission.id)
            queue.finish(session, check, NOW)
            submission.content = submission.digest
            submissions.accept(session, submission, range(TRIALS), NOW)
        leased = queue.take(session, "w", NOW, 60.0, unjudged)
        assert leased is not None
        assert leased.submission.phase.name == "practice"
        submissions.taken(leased.submission, leased, NOW)
        queue.finish(session, leased, NOW)
        assert queue.take(session, "w", NOW, 60.0, unjudged) is None
    keyless.clock.at += submissions.DEADLINES["queued"] + 1.0
    housekeeping.sweep(keyless)
    with keyless.database.reading() as session:
        states = dict(session.execute(select(Submission.id, Submission.state)).all())
        assert states[1] == "queued"
        document = viewing.submission_document(keyless, session, session.get_one(Submission, 1), None, {})
        assert document["active"]
        names = [viewing.phase_document(keyless, row, NOW)["waits_for_key"] for row in session.scalars(select(Phase))]
        assert names == [False, True, True]
    with TestClient(create_app(keyless)) as client:
        assert {client.get(path).status_code for path in ("/", "/c/short", "/c/short/validation")} == {200}
        assert "the organiser has yet to give the service the key" in client.get("/c/short/test").text
    (tmp_path / "elsewhere.key").rename(key)
    with keyless.database.writing() as session:
        assert keyless.waiting_for_key(session) == []
        leased = queue.take(session, "w", keyless.clock(), 60.0)
        assert leased is not None
        assert leased.submission_id == 1
    keyless.close()


@pytest.mark.usefixtures("service")
def test_another_key_opens_nothing_and_is_told_at_the_start(tmp_path: Path) -> None:
    key = tmp_path / "here.key"
    kept = key.read_text()
    key.write_text("f" * 64)
    with pytest.raises(NoKeyError, match=r"here\.key: not the key of this folder") as told:
        opened(tmp_path)
    assert "f" * 8 not in str(told.value)
    key.unlink()
    keyless = opened(tmp_path)
    key.write_text("f" * 64)
    assert not keyless.has_key()
    key.write_text(kept)
    assert keyless.has_key()
    keyless.close()


@pytest.mark.usefixtures("service")
def test_no_key_is_taken_for_the_folder_s_where_nobody_can_tell(tmp_path: Path) -> None:
    """As in a backup without it: a wrong key was kept for good, and the right one refused."""
    key, check = tmp_path / "here.key", tmp_path / "here" / "key.check"
    kept = key.read_text()
    check.unlink()
    key.write_text("f" * 64)
    opened(tmp_path).close()
    assert not check.exists()
    key.write_text(kept)
    opened(tmp_path).close()


def test_a_worker_is_given_the_seed_of_one_trial_of_its_lease(service: Service) -> None:
    with service.database.writing() as session:
        submission = handed(session, service, "test")
        queue.drop(session, submission, NOW)
        submission.content = submission.digest
        submissions.accept(session, submission, range(TRIALS), NOW)
        token = accounts.new_token(session, "w", None, NOW)
        seeds = service.seeds(submission.phase)
    with TestClient(create_app(service)) as client:
        client.headers["authorization"] = f"Bearer {token}"
        answer = client.post("/worker/lease", json={"name": "w"})
        lease = answer.json()
        assert not any(str(seed) in answer.text for seed in seeds)
        held = {"token": lease["token"]}
        where = f"/worker/chunks/{lease['chunk']}/trials"
        for number in lease["numbers"]:
            assert client.post(f"{where}/{number}/seed", json=held).json() == {"seed": str(seeds[number])}
        beyond = max(lease["numbers"]) + 1
        assert client.post(f"{where}/{beyond}/seed", json=held).status_code == 404
        stale = {"token": lease["token"] + 1}
        assert client.post(f"{where}/{lease['numbers'][0]}/seed", json=stale).status_code == 409


def test_while_nobody_organises_all_the_first_organiser_is_invited(service: Service) -> None:
    """Whoever organises one competition can't make another one, nor an organiser of all."""
    first = prepare(service, [], "http://here")
    assert first is not None
    with service.database.writing() as session:
        short = receiving.competition_named(session, "short")
        code = accounts.invite(session, accounts.ORGANISER, None, NOW, organises=short)
    accounts.join(service.database, code, "Odo", "correct horse", "", NOW)
    again = prepare(service, [], "http://here")
    assert again is not None
    assert again != first
    accounts.join(service.database, again.partition("code=")[2], "Olga", "correct horse", "", NOW)
    assert prepare(service, [], "http://here") is None
