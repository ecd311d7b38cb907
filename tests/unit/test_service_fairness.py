"""Ways to gain more than one's share, or to see more than one may, and that they lead nowhere."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from sqlalchemy import func, select
from sqlalchemy.orm import Session

from dubins_traffic.competition.competition import Quota
from dubins_traffic.service import accounts, housekeeping, organising, queue, receiving, submissions, viewing
from dubins_traffic.service.accounts import WrongEntryError
from dubins_traffic.service.database_tables import Account, Chunk, Phase, Submission, Trial
from dubins_traffic.service.hiding import NOTHING
from dubins_traffic.service.service import Service
from dubins_traffic.service.submissions import RefusedError, Upload
from tests.services import competition_text

NOW = 2_000_000_000.0
QUOTA = Quota(a_day=2)


class Clock:
    """A clock that a test sets."""

    at = NOW

    def __call__(self) -> float:
        return self.at


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    made = Service(tmp_path / "here", tmp_path / "here.key", Clock())
    made.database.migrate()
    organising.create(made, "short", {"competition.toml": competition_text(12).encode()}, None)
    yield made
    made.close()


def joined(service: Service, name: str = "Ann", team: str = "Ants") -> Account:
    """Let a person join with a team of its own."""
    with service.database.writing() as session:
        code = accounts.invite(session, accounts.PARTICIPANT, None, NOW)
    return accounts.join(service.database, code, name, "correct horse", team, NOW)


def handed(session: Session, service: Service, account: Account, name: str, phase: str = "test") -> Submission:
    row = receiving.phase_named(session, "short", phase)
    upload = Upload(accounts.digest_of(name), name, 1)
    return submissions.receive(session, row, QUOTA, account, upload, service.clock())[0]


def checked(session: Session, submission: Submission, trials: int = 12) -> None:
    """Let the check of a submission be done, and its trials wait."""
    queue.drop(session, submission, NOW)
    submission.content = submission.digest
    submissions.accept(session, submission, range(trials), NOW)


def taken(session: Session, at: float = NOW) -> Chunk:
    chunk = queue.take(session, "w", at, 60.0)
    assert chunk is not None
    submissions.taken(session.get_one(Submission, chunk.submission_id), chunk, at)
    return chunk


def results(numbers: list[int], frames: str = "f") -> list[dict[str, object]]:
    same = {
        "row": {"end": "duration"},
        "end": "duration",
        "owner": None,
        "log": "",
        "replay": None,
        "own_replay": None,
    }
    return [{"number": number, "frames": frames, "ran": "boxed", **same} for number in numbers]


def test_what_was_cancelled_while_it_ran_does_not_run_again_for_the_same_price(service: Service) -> None:
    ann = joined(service)
    with service.database.writing() as session:
        submission = handed(session, service, ann, "x")
        checked(session, submission)
        submissions.record(session, taken(session), results(list(range(10))), NOW, NOTHING)
        submissions.cancel(session, submission, NOW)
        again = handed(session, service, ann, "x")
        assert (again.id, again.state, again.costs, again.run) == (submission.id, "cancelled", True, 0)


def test_what_ran_and_is_judged_again_is_not_free_when_it_is_cancelled(service: Service) -> None:
    ann = joined(service)
    with service.database.writing() as session:
        submission = handed(session, service, ann, "x")
        checked(session, submission)
        submissions.record(session, taken(session), results(list(range(10))), NOW, NOTHING)
        submissions.judge_again(session, submission, range(12), NOW)
        assert submission.state == "queued"
        submissions.cancel(session, submission, NOW)
        assert submission.costs


def test_the_same_is_not_sent_and_cancelled_for_ever(service: Service) -> None:
    ann = joined(service)
    with service.database.writing() as session:
        for _ in range(submissions.MOST_REPEATS + 1):
            submissions.cancel(session, handed(session, service, ann, "x"), NOW)
        with pytest.raises(RefusedError, match="too often"):
            handed(session, service, ann, "x")


def test_who_was_disqualified_is_not_let_in_by_sending_the_same_again(service: Service) -> None:
    ann = joined(service)
    with service.database.writing() as session:
        submission = handed(session, service, ann, "x")
        organising.disqualify(service, session, submission, ann, "it tried to get out")
        submissions.cancel(session, submission, NOW)
        again = handed(session, service, ann, "x")
        assert (again.state, again.disqualified) == ("received", "it tried to get out")


def test_what_is_refused_fills_no_disk(service: Service) -> None:
    ann = joined(service)

    def kept() -> int:
        return sum(1 for path in (service.folder / "store").rglob("*") if path.is_file())

    def send(text: str, phase: str = "test") -> None:
        receiving.take_in(service, ann, "short", phase, "x.py", text.encode())

    for text in ("1", "2", "3"):
        send(text)
    assert kept() == 3
    with pytest.raises(RefusedError, match="3 of 3 submissions today"):
        send("4")
    with service.database.writing() as session:
        receiving.phase_named(session, "short", "test").closes = NOW - 1.0
    with pytest.raises(RefusedError, match="closed"):
        send("5")
    assert kept() == 3
    send("1")


def test_a_team_sends_so_many_bytes_an_hour(service: Service) -> None:
    """What is rejected costs no quota, yet it lies in the store."""
    ann = joined(service)
    with service.database.writing() as session:
        row = receiving.phase_named(session, "short", "practice")
        for name in ("a", "b"):
            big = Upload(accounts.digest_of(name), name, submissions.MOST_BYTES // 2)
            submission, _ = submissions.receive(session, row, Quota(), ann, big, NOW)
            submissions.reject(session, submission, "no class", NOW)
        upload = Upload(accounts.digest_of("c"), "c", 1)
        with pytest.raises(RefusedError, match="MiB in an hour"):
            submissions.receive(session, row, Quota(), ann, upload, NOW)
        assert submissions.receive(session, row, Quota(), ann, upload, NOW + submissions.HOUR)[1]


def test_a_slow_submission_that_goes_on_does_not_fail_by_our_fault(service: Service) -> None:
    ann = joined(service)
    with service.database.writing() as session:
        submission = handed(session, service, ann, "x")
        checked(session, submission)
        late = NOW + submissions.DEADLINES["queued"] - 1.0
        chunk = taken(session, late)
        later = late + submissions.DEADLINES["running"] - 1.0
        submissions.record(session, chunk, results(chunk.numbers), later, NOTHING)
        housekeeping.end_overdue(session, later + 2.0)
        assert submission.state == "running"
        housekeeping.end_overdue(session, later + submissions.DEADLINES["running"] + 1.0)
        assert submission.state == "failed"


def test_a_chunk_that_takes_long_is_reported_in_parts_and_others_come_between(service: Service) -> None:
    ann, bob = joined(service), joined(service, "Bob", "Bees")
    with service.database.writing() as session:
        slow = handed(session, service, ann, "slow")
        checked(session, slow)
        chunk = taken(session)
        other = handed(session, service, bob, "other")
        submissions.record(session, chunk, results([0, 1]), NOW + 1.0, NOTHING)
        assert taken(session).submission_id == other.id
        while (next_one := queue.take(session, "w", NOW, 60.0)) is not None:
            submissions.record(session, next_one, results(next_one.numbers), NOW, NOTHING)
        assert [trial.number for trial in submissions.trials(session, slow, NOTHING)] == list(range(12))
        assert slow.state == "scoring"
        with pytest.raises(RefusedError, match="other trials"):
            submissions.record(session, chunk, [], NOW, NOTHING)


def test_the_sample_is_compared_whatever_ends_first(service: Service) -> None:
    """It is queued when all trials are there; before, a second worker could end it first, and it was lost."""
    ann = joined(service)
    with service.database.writing() as session:
        submission = handed(session, service, ann, "x")
        checked(session, submission)
        leased = [taken(session), taken(session)]
        assert queue.take(session, "w", NOW, 60.0) is None
        for chunk in reversed(leased):
            submissions.record(session, chunk, results(chunk.numbers), NOW, NOTHING)
        again = taken(session)
        assert again.kind == "again"
        submissions.record(session, again, results(again.numbers, "g"), NOW, NOTHING)
        assert viewing.differing(service, session, submission) == again.numbers


def test_nobody_knows_which_trials_run_twice() -> None:
    """The sample followed from the digest: a team could make one whose sample suits it."""
    drawn = {tuple(submissions.sample(range(400))) for _ in range(8)}
    assert len(drawn) > 1
    assert all(len(set(own)) == 20 for own in drawn)
    assert submissions.sample([7]) == [7]


def test_a_secret_phase_shows_no_time_at_which_something_happened(service: Service) -> None:
    """A deadline moves with the state: it told when a submission began to run, and when each part of it was done."""
    ann = joined(service)
    seen: list[object] = []
    with service.database.writing() as session:
        submission = handed(session, service, ann, "x")
        checked(session, submission)
        for at in (NOW + 100.0, NOW + 200.0):
            submissions.enter(submission, "running", at)
            seen.append(viewing.submission_document(service, session, submission, ann, {}))
        open_phase = handed(session, service, ann, "y", "practice")
        assert viewing.submission_document(service, session, open_phase, ann, {})["deadline"] is not None
    assert seen[0] == seen[1]


def test_what_was_not_checked_is_not_judged_again(service: Service) -> None:
    """Its trials would be found to be none by every worker, and it would fail by our fault, free of charge."""
    ann = joined(service)
    with service.database.writing() as session:
        submission = handed(session, service, ann, "x")
        with pytest.raises(RefusedError, match="checked"):
            submissions.judge_again(session, submission, range(12), NOW)
        assert session.scalar(select(func.count()).select_from(Trial)) == 0


def test_names_are_one_s_own_in_every_spelling_and_their_owner_can_log_in(service: Service) -> None:
    """SQLite knows capitals of ASCII alone."""
    joined(service, "Änne", "Ökobienen")
    for name, team in (("änne", "x"), ("Bob", "ÖKOBIENEN"), ("removed 7", "x"), ("REMOVED 7", "x")):
        with pytest.raises(WrongEntryError, match="taken"):
            joined(service, name, team)
    with service.database.reading() as session:
        for typed in ("Änne", "änne", " ÄNNE "):
            assert accounts.verified(session, typed, "correct horse") is not None
        assert accounts.verified(session, "Änne", "wrong horse!") is None


def test_a_removed_account_is_removed_whatever_others_are_called(service: Service) -> None:
    ann = joined(service)
    with service.database.writing() as session:
        accounts.remove(session, session.get_one(Account, ann.id), NOW)
    with service.database.reading() as session:
        assert session.get_one(Account, ann.id).name == f"removed {ann.id}"
        assert accounts.verified(session, f"removed {ann.id}", "none") is None


def test_another_team_s_bytes_are_another_submission(service: Service) -> None:
    """Who knows what another team has sent learns nothing of it, and takes nothing from it."""
    ann, bob = joined(service), joined(service, "Bob", "Bees")
    with service.database.writing() as session:
        first, second = handed(session, service, ann, "x"), handed(session, service, bob, "x")
        assert (first.id != second.id, first.digest) == (True, second.digest)
        submissions.cancel(session, second, NOW)
        assert first.state == "received"
        with pytest.raises(receiving.UnknownError):
            receiving.submission_numbered(session, first.id, bob)


def test_nothing_is_named_when_a_phase_has_closed(service: Service) -> None:
    ann = joined(service)
    with service.database.writing() as session:
        number = handed(session, service, ann, "x").id
        phase: Phase = receiving.phase_named(session, "short", "test")
        phase.closes = NOW
    with pytest.raises(RefusedError, match="closed"):
        receiving.name_it(service, ann, number)
