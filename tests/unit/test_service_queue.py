"""The queue and the life of submissions in a database: SQLite, and PostgreSQL where it is installed."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from sqlalchemy import inspect, select, text
from sqlalchemy.exc import DBAPIError, OperationalError
from sqlalchemy.orm import Session

from dubins_traffic.competition.competition import Quota
from dubins_traffic.service import accounts, housekeeping, queue, submissions
from dubins_traffic.service.database import Database
from dubins_traffic.service.database_tables import (
    Account,
    Act,
    Chunk,
    Competition,
    Phase,
    Submission,
    Team,
    Trial,
)
from dubins_traffic.service.hiding import NOTHING
from dubins_traffic.service.service import Service
from dubins_traffic.service.submissions import RefusedError, Upload
from tests import postgres

NUMBERS = itertools.count()


@pytest.fixture(scope="module")
def cluster() -> Iterator[postgres.Cluster]:
    with postgres.cluster() as made:
        yield made


@pytest.fixture(params=["sqlite", pytest.param("postgresql", marks=pytest.mark.tools)])
def database(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Database]:
    if request.param == "sqlite":
        url = f"sqlite:///{tmp_path / 'queue.db'}"
    else:
        url = request.getfixturevalue("cluster").url(f"queue{next(NUMBERS)}")
    made = Database(url)
    made.migrate()
    yield made
    made.close()


def furnished(session: Session, teams: int = 3, shows: str = "all") -> tuple[Phase, list[Account]]:
    """Add a competition with a phase that is open, and teams of one."""
    competition = Competition(slug="c", title="C", document="{}", created=0.0)
    phase = Phase(name="p", shows=shows, opens=10.0, closes=1000.0, competition=competition)
    session.add(phase)
    people: list[Account] = []
    for number in range(teams):
        team = accounts.make_team(session, f"t{number}", 1.0)
        person = Account(name=f"a{number}", password="none", role="participant", team=team, created=1.0)
        session.add(person)
        people.append(person)
    session.flush()
    return phase, people


def sent(session: Session, phase: Phase, account: Account, name: str, at: float = 20.0) -> Submission:
    """Let an account hand in something of its own."""
    digest = accounts.digest_of(f"{account.id} {name}")
    found, _ = submissions.receive(session, phase, Quota(), account, Upload(digest, f"{name}.py", 1), at)
    return found


def checked(session: Session, submission: Submission, trials: int = 20) -> None:
    """Take the check of a submission from the queue, and accept it."""
    chunk = session.scalars(select(Chunk).where(Chunk.submission_id == submission.id)).one()
    chunk.state, chunk.token = "leased", 1
    queue.finish(session, chunk, 20.0)
    submission.content = submission.digest
    submissions.accept(session, submission, range(trials), 20.0)


def results(chunk: Chunk, frames: str = "f") -> list[dict[str, object]]:
    row = {"number": 0, "end": "duration"}
    return [
        {
            "number": n,
            "row": row,
            "end": "duration",
            "owner": None,
            "log": "",
            "frames": frames,
            "ran": "boxed",
            "replay": None,
            "own_replay": None,
        }
        for n in chunk.numbers
    ]


def test_the_queue_goes_round_the_teams(database: Database) -> None:
    with database.writing() as session:
        phase, people = furnished(session)
        for number in range(5):
            checked(session, sent(session, phase, people[0], f"many {number}"))
        served = [queue.take(session, "w", 30.0, 60.0) for _ in range(3)]
        assert [chunk and chunk.team_id for chunk in served] == [people[0].team_id] * 3
        late = sent(session, phase, people[1], "late")
        other = sent(session, phase, people[2], "other")
        assert queue.places(session, 30.0)[late.id] == 1
        assert queue.places(session, 30.0)[other.id] == 2
        nearest = queue.take(session, "w", 30.0, 60.0)
        assert nearest is not None
        assert nearest.submission_id == late.id
        assert queue.places(session, 30.0)[other.id] == 1


def test_places_are_those_in_which_chunks_are_served(database: Database) -> None:
    with database.writing() as session:
        phase, people = furnished(session)
        for account, count in zip(people, (3, 1, 2), strict=True):
            for number in range(count):
                checked(session, sent(session, phase, account, f"{number}"))
        foretold = dict(queue.places(session, 30.0))
        order: list[int] = []
        while (chunk := queue.take(session, "w", 30.0, 60.0)) is not None:
            order.append(chunk.submission_id)
        assert foretold == {number: order.index(number) + 1 for number in foretold}
        assert len(foretold) == 6


def test_only_the_latest_lease_may_report(database: Database) -> None:
    with database.writing() as session:
        phase, people = furnished(session)
        submission = sent(session, phase, people[0], "x")
        first = queue.take(session, "dies", 30.0, 60.0)
        assert first is not None
        number, token = first.id, first.token
        submissions.taken(submission, first, 30.0)
        assert submission.state == "checking"
        housekeeping.end_leases(session, 89.0)
        assert queue.held(session, number, token) is first
        housekeeping.end_leases(session, 91.0)
        assert queue.take(session, "too early", 91.0, 60.0) is None
        second = queue.take(session, "lives", 99.0, 60.0)
        assert second is not None
        assert second.token > token
        with pytest.raises(queue.StaleLeaseError):
            queue.held(session, number, token)
        assert queue.held(session, number, second.token) is second


def test_a_service_that_was_away_ends_no_lease(tmp_path: Path) -> None:
    service = Service(tmp_path, clock=lambda: now[0])
    service.database.migrate()
    now = [30.0]
    with service.database.writing() as session:
        phase, people = furnished(session)
        sent(session, phase, people[0], "x")
        assert queue.take(session, "w", now[0], 60.0) is not None
    now[0] += 1000.0
    for was_away, seconds, left in ((True, 59.0, True), (False, 2.0, False)):
        housekeeping.end_silent(service, was_away=was_away)
        now[0] += seconds
        housekeeping.end_silent(service)
        with service.database.reading() as session:
            assert (session.scalars(select(Chunk.state)).one() == "leased") == left
    service.close()


def test_no_lease_ends_while_writers_find_the_database_away(tmp_path: Path) -> None:
    """A disk was full between two sweeps: heartbeats failed, but housekeeping, which had nothing to write, did not."""
    service = Service(tmp_path, clock=lambda: now[0])
    service.database.migrate()
    now, tries = [30.0], list[int]()
    with service.database.writing() as session:
        phase, people = furnished(session)
        sent(session, phase, people[0], "x")
        assert queue.take(session, "w", now[0], 60.0) is not None
    keeper = housekeeping.Housekeeper(service)
    keeper.sweep()

    def beat(_session: Session) -> None:
        tries.append(len(tries))
        if len(tries) == 1:
            raise OperationalError("UPDATE chunk", None, Exception("database or disk is full"))

    for away, state in ((True, "leased"), (False, "waiting")):
        now[0] += 61.0
        if away:
            service.database.patiently(beat)
        keeper.sweep()
        with service.database.reading() as session:
            assert session.scalars(select(Chunk.state)).one() == state
    assert tries == [0, 1]
    service.close()


def test_a_chunk_that_kills_its_workers_ends_its_submission_by_our_fault(database: Database) -> None:
    with database.writing() as session:
        phase, people = furnished(session)
        submission = sent(session, phase, people[0], "x")
        at = 30.0
        for _ in range(queue.ATTEMPTS):
            assert queue.take(session, "w", at, 60.0) is not None
            at += 61.0
            housekeeping.end_leases(session, at)
            at += 60.0
        assert (submission.state, submission.fault, submission.costs) == ("failed", "platform", False)
        assert queue.take(session, "w", at, 60.0) is None
        again = sent(session, phase, people[0], "x", 900.0)
        assert (again.id, again.state, again.run) == (submission.id, "received", 1)


def test_what_is_given_back_in_order_is_no_attempt(database: Database) -> None:
    with database.writing() as session:
        phase, people = furnished(session)
        sent(session, phase, people[0], "x")
        for _ in range(3 * queue.ATTEMPTS):
            chunk = queue.take(session, "w", 30.0, 60.0)
            assert chunk is not None
            queue.release(session, chunk, "stopped", 30.0, worker_left=True)


def test_state_and_queue_commit_together_or_not_at_all(database: Database) -> None:
    with database.writing() as session:
        phase, people = furnished(session)
        submission = sent(session, phase, people[0], "x")
        checked(session, submission, 4)
        chunk = queue.take(session, "w", 30.0, 60.0)
        assert chunk is not None
        number, token, chunk_id = submission.id, chunk.token, chunk.id

    def cut_off() -> None:
        with database.writing() as session:
            held = queue.held(session, chunk_id, token)
            submissions.record(session, held, results(held), 40.0, NOTHING)
            raise RuntimeError("the plug was pulled")

    with pytest.raises(RuntimeError, match="pulled"):
        cut_off()
    with database.reading() as session:
        assert session.scalars(select(Trial)).all() == []
        assert session.get_one(Chunk, chunk_id).state == "leased"
    for _ in range(2):
        with database.writing() as session:
            held = session.get_one(Chunk, chunk_id)
            if held.state == "leased":
                submissions.record(session, queue.held(session, chunk_id, token), results(held), 40.0, NOTHING)
            else:
                with pytest.raises(queue.StaleLeaseError):
                    queue.held(session, chunk_id, token)
    with database.reading() as session:
        found = session.scalars(select(Trial).where(Trial.submission_id == number)).all()
        assert [trial.number for trial in found] == [0, 1, 2, 3]


def test_a_sample_is_run_twice_and_frames_are_compared(database: Database) -> None:
    with database.writing() as session:
        phase, people = furnished(session)
        submission = sent(session, phase, people[0], "x")
        checked(session, submission, 40)
        frames = iter("fgh")
        while (chunk := queue.take(session, "w", 30.0, 60.0)) is not None:
            own = "other" if chunk.kind == "again" else next(frames, "f")
            submissions.record(session, chunk, results(chunk, own), 40.0, NOTHING)
        assert submission.state == "scoring"
        twice = [trial for trial in submissions.trials(session, submission, NOTHING) if trial.again is not None]
        assert len(twice) == 2
        assert all(trial.again == "other" for trial in twice)


def test_results_of_other_trials_are_refused(database: Database) -> None:
    with database.writing() as session:
        phase, people = furnished(session)
        checked(session, sent(session, phase, people[0], "x"), 4)
        chunk = queue.take(session, "w", 30.0, 60.0)
        assert chunk is not None
        with pytest.raises(RefusedError, match="other trials"):
            submissions.record(session, chunk, results(chunk)[1:], 40.0, NOTHING)


def test_what_is_received_before_the_closing_second_counts(database: Database) -> None:
    with database.writing() as session:
        phase, people = furnished(session)
        for at, allowed in ((9.99, False), (10.0, True), (999.99, True), (1000.0, False)):
            if allowed:
                sent(session, phase, people[0], f"at {at}", at)
            else:
                with pytest.raises(RefusedError, match=r"open|closed"):
                    sent(session, phase, people[0], f"at {at}", at)


def test_our_faults_and_rejections_cost_no_quota(database: Database) -> None:
    quota = Quota(a_day=2, total=3, queued=2)
    day = 86400.0

    def hand_in(session: Session, phase: Phase, account: Account, name: str, at: float) -> Submission:
        upload = Upload(accounts.digest_of(name), name, 1)
        return submissions.receive(session, phase, quota, account, upload, at)[0]

    with database.writing() as session:
        phase, (account, *_) = furnished(session)
        phase.closes = 10 * day
        submissions.fail(session, hand_in(session, phase, account, "a", 20.0), "disk", 21.0)
        submissions.reject(session, hand_in(session, phase, account, "b", 22.0), "no class", 23.0)
        submissions.cancel(session, hand_in(session, phase, account, "c", 24.0), 25.0)
        first = hand_in(session, phase, account, "d", 26.0)
        checked(session, first, 2)
        submissions.enter(first, "running", 27.0)
        submissions.cancel(session, first, 28.0)
        assert first.costs
        second = hand_in(session, phase, account, "e", 29.0)
        with pytest.raises(RefusedError, match="2 of 2 submissions today"):
            hand_in(session, phase, account, "f", 30.0)
        again, new = submissions.receive(session, phase, quota, account, Upload(second.digest, "e", 1), 31.0)
        assert (again.id, new) == (second.id, False)
        hand_in(session, phase, account, "g", day)
        with pytest.raises(RefusedError, match="3 of 3 submissions in this phase"):
            hand_in(session, phase, account, "h", 2 * day)


def test_what_stays_too_long_fails_by_our_fault(database: Database) -> None:
    with database.writing() as session:
        phase, people = furnished(session)
        submission = sent(session, phase, people[0], "x")
        housekeeping.end_overdue(session, submission.deadline - 1.0)
        assert submission.state == "received"
        housekeeping.end_overdue(session, submission.deadline + 1.0)
        assert (submission.state, submission.fault, submission.costs) == ("failed", "platform", False)


def test_many_writers_never_lease_a_chunk_twice(database: Database) -> None:
    with database.writing() as session:
        phase, people = furnished(session)
        for account in people:
            for number in range(4):
                sent(session, phase, account, f"{number}")
    got: list[tuple[int, int]] = []

    def work() -> None:
        while True:
            with database.writing() as session:
                chunk = queue.take(session, "w", 30.0, 60.0)
                if chunk is None:
                    return
                got.append((chunk.id, chunk.token))

    threads = [threading.Thread(target=work) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(got) == len(set(got)) == 12


def test_the_log_of_acts_only_grows(database: Database) -> None:
    with database.writing() as session:
        accounts.note(session, None, "create", "c", "", 1.0)
    for change in ("UPDATE act SET subject = 'x'", "DELETE FROM act"):
        with pytest.raises(DBAPIError, match="only grows"), database.writing() as session:
            session.execute(text(change))
    with database.reading() as session:
        assert session.scalars(select(Act.subject)).all() == ["c"]


def test_tables_are_removed_and_made_again(database: Database) -> None:
    from alembic import command
    from alembic.config import Config

    config = Config()
    config.set_main_option("script_location", "src/dubins_traffic/service/migrations")
    with database.engine.execution_options(writes=True).begin() as connection:
        config.attributes["connection"] = connection
        command.downgrade(config, "base")
        assert inspect(connection).get_table_names() == ["alembic_version"]
    database.migrate()
    with database.writing() as session:
        accounts.note(session, None, "create", "c", "", 1.0)
    with pytest.raises(DBAPIError, match="only grows"), database.writing() as session:
        session.execute(text("DELETE FROM act"))


def test_the_tables_are_those_of_the_migrations(database: Database) -> None:
    from alembic.autogenerate import compare_metadata
    from alembic.migration import MigrationContext

    from dubins_traffic.service.database_tables import Base

    with database.engine.connect() as connection:
        assert compare_metadata(MigrationContext.configure(connection), Base.metadata) == []


@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.parametrize(("slow", "submissions_of_theirs"), [(20.0, 6), (0.1, 150)], ids=["sleep", "crash"])
def test_no_team_has_more_than_a_share_of_the_time(
    database: Database, workers: int, slow: float, submissions_of_theirs: int
) -> None:
    """Another team's first result took nine times as long as alone, when turns were counted in chunks.

    Time is told by what is served: a trial of who sleeps takes 20 s, of who crashes 0.1 s, of the other team 1 s.
    """
    quick, trials = 1.0, 30
    with database.writing() as session:
        phase, people = furnished(session, teams=2)
        for number in range(submissions_of_theirs):
            checked(session, sent(session, phase, people[0], f"theirs {number}"), trials)
        late: Submission | None = None
        at, busy = 30.0, list[tuple[float, Chunk, int]]()
        began = 0.0
        while late is None or late.state != "scoring":
            while len(busy) < workers and (chunk := queue.take(session, "w", at, 600.0)) is not None:
                submissions.taken(chunk.submission, chunk, at)
                each = slow if chunk.team_id == people[0].team_id else quick
                busy.append((at + each, chunk, 1))
            at, chunk, done = min(busy, key=lambda one: one[0])
            busy.remove((at, chunk, done))
            if chunk.kind == "check":
                queue.finish(session, chunk, at)
                chunk.submission.content = chunk.submission.digest
                submissions.accept(session, chunk.submission, range(trials), at)
            else:
                submissions.record(session, chunk, results(chunk)[:done], at, NOTHING)
            if late is None and at >= 90.0:
                late, began = sent(session, phase, people[1], "quick", at), at
        alone = quick * (trials + 2) / workers
        assert at - began <= 3.0 * alone + slow


def test_a_team_that_was_idle_has_saved_nothing_and_owes_nothing(database: Database) -> None:
    with database.writing() as session:
        phase, people = furnished(session, teams=2)
        first, second = (session.get_one(Team, account.team_id) for account in people)
        first.turn, second.turn = 5000.0, 100.0
        sent(session, phase, people[0], "x")
        chunk = queue.take(session, "w", 30.0, 600.0)
        assert chunk is not None
        sent(session, phase, people[1], "y", 70.0)
        assert (first.turn, second.turn) == (5000.0, 5040.0)
        queue.release(session, chunk, "silent", 90.0)
        assert first.turn == 5060.0
        queue.drop(session, chunk.submission, 95.0)
        assert first.turn == 5060.0


def test_what_runs_again_is_done_before_the_team_s_next_submission(database: Database) -> None:
    """Of six submissions the first was finished after all trials of the last."""
    with database.writing() as session:
        phase, people = furnished(session, teams=1)
        own = [sent(session, phase, people[0], f"{number}") for number in range(3)]
        for submission in own:
            checked(session, submission)
        finished: list[int] = []
        while (chunk := queue.take(session, "w", 30.0, 60.0)) is not None:
            assert [one.state for one in own].count("scoring") == own.index(chunk.submission)
            submissions.record(session, chunk, results(chunk), 30.0, NOTHING)
            if chunk.submission.state == "scoring":
                finished.append(chunk.submission_id)
        assert finished == [submission.id for submission in own]
