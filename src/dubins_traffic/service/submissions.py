"""The life of a submission: received, checking, queued, running, scoring, then done, rejected, failed or cancelled."""

from __future__ import annotations

import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import func, select, update
from sqlalchemy.orm import Session, defer, undefer

from dubins_traffic.competition.competition import Quota, run_twice
from dubins_traffic.errors import DubinsTrafficError, shown
from dubins_traffic.service import queue
from dubins_traffic.service.database_tables import Account, Chunk, Phase, Submission, Trial
from dubins_traffic.service.hiding import Hiding

HOUR = 3600.0
DEADLINES = {"received": HOUR, "checking": HOUR, "queued": 168 * HOUR, "running": 48 * HOUR, "scoring": HOUR}
"""How long a submission may stay in a state, seconds; what stays longer fails by our fault."""
ACTIVE = tuple(DEADLINES)
OURS, THEIRS = "platform", "submission"
CHUNK = 10
"""Trials in a unit of work."""
MOST_UPLOADS = 200
"""Uploads of a team in an hour, rejected ones too: each costs us a check."""
MOST_BYTES = 512 << 20
"""Bytes of these: what is rejected costs no quota, and yet it is kept."""
MOST_REPEATS = 20
"""So often may the same be handed in again that was cancelled or failed by our fault."""
REASONS = {
    "received": "waits for a worker that checks it",
    "checking": "a worker looks whether it can be run",
    "queued": "waits for its turn",
    "running": "its trials are run",
    "scoring": "all trials are run; the table is made anew",
    "done": "all trials are judged",
}


class RefusedError(DubinsTrafficError):
    """What was asked for is not allowed now: a closed phase, a quota that is used up, a state it is too late for."""


@dataclass(frozen=True)
class Upload:
    """What a participant has sent: SHA-256 of its bytes, its name and size."""

    digest: str
    filename: str
    size: int


def enter(submission: Submission, state: str, at: float, reason: str = "", fault: str = "") -> None:
    """Put a submission into a state, with the reason and whose fault it is."""
    submission.state, submission.changed = state, at
    submission.reason, submission.fault = reason or REASONS.get(state, ""), fault
    submission.deadline = at + DEADLINES.get(state, 0.0)


def receive(
    session: Session, phase: Phase, quota: Quota, account: Account, upload: Upload, at: float
) -> tuple[Submission, bool]:
    """Take in what a team has sent, and queue its check; the same bytes again are the same submission.

    Returns
    -------
    tuple of Submission and bool
        The submission, and whether it is new.

    Raises
    ------
    RefusedError
        If the account is in no team, the phase is not open at `at`, or the team's quota is used up.
    """
    known = admitted(session, phase, quota, account, upload, at)
    if known is not None and not _may_repeat(known):
        return known, False
    if known is None:
        known = Submission(phase_id=phase.id, team_id=account.team_id, digest=upload.digest, size=upload.size)
        known.run = 0
    else:
        known.run += 1
    begin(session, known, account, upload, at)
    return known, True


def begin(session: Session, submission: Submission, account: Account, upload: Upload, at: float) -> None:
    """Queue the check of a submission that is taken in."""
    submission.account_id, submission.filename = account.id, shown(upload.filename, 100)
    submission.received, submission.costs = at, True
    enter(submission, "received", at)
    session.add(submission)
    session.flush()
    queue.arrive(session, submission.team_id, at)
    queue.add(session, submission, "check", [[]])


def admitted(
    session: Session, phase: Phase, quota: Quota, account: Account, upload: Upload, at: float
) -> Submission | None:
    """Return the submission that an upload is the same as, None if it is a new one; it may be taken in.

    RefusedError as for `receive`, of which this is the part that keeps nothing.
    """
    if account.team_id is None:
        raise RefusedError("you are in no team: join or found one first")
    same = select(Submission).where(
        Submission.phase_id == phase.id,
        Submission.team_id == account.team_id,
        Submission.digest == upload.digest,
    )
    known = session.scalars(same).first()
    if known is not None and not _may_repeat(known):
        return known
    if not phase.is_open(at):
        raise RefusedError("the phase is closed" if phase.is_closed(at) else "the phase is not open yet")
    if known is not None and known.run >= MOST_REPEATS:
        raise RefusedError("the same was handed in again too often: change it")
    _within_quota(session, phase, quota, account.team_id, at)
    _within_an_hour(session, account.team_id, upload, at)
    return known


def _may_repeat(submission: Submission) -> bool:
    """Whether sending the same again begins anew: it was cancelled before it ran, or failed by our fault.

    What was cancelled while it ran has shown something, and has cost: it would run a second time for the same price.
    """
    if submission.state == "cancelled":
        return not submission.costs
    return submission.state == "failed" and submission.fault == OURS


def used(session: Session, phase: Phase, team_id: int, at: float) -> tuple[int, int, int]:
    """Return how many submissions of a team count today (from 0:00 UTC), in the phase, and wait or run."""
    day = datetime.fromtimestamp(at, UTC).replace(hour=0, minute=0, second=0, microsecond=0).timestamp()
    of_team = select(func.count()).where(Submission.phase_id == phase.id, Submission.team_id == team_id)
    costs = of_team.where(Submission.costs)
    active = of_team.where(Submission.state.in_(ACTIVE))
    counted = (session.scalar(query) or 0 for query in (costs.where(Submission.received >= day), costs, active))
    today, total, queued = counted
    return today, total, queued


def _within_quota(session: Session, phase: Phase, quota: Quota, team_id: int, at: float) -> None:
    names = ("today", "in this phase", "that wait or run")
    limits = (quota.a_day, quota.total, quota.queued)
    for name, limit, count in zip(names, limits, used(session, phase, team_id, at), strict=True):
        if limit is not None and count >= limit:
            raise RefusedError(f"the quota is used up: {count} of {limit} submissions {name}")


def _within_an_hour(session: Session, team_id: int, upload: Upload, at: float) -> None:
    lately = select(Submission.size).where(Submission.team_id == team_id, Submission.received > at - HOUR)
    sizes = session.scalars(lately).all()
    if len(sizes) >= MOST_UPLOADS:
        raise RefusedError(f"more than {MOST_UPLOADS} uploads in an hour: try later")
    if sum(sizes) + upload.size > MOST_BYTES:
        raise RefusedError(f"more than {MOST_BYTES >> 20} MiB in an hour: try later")


def taken(submission: Submission, chunk: Chunk, at: float) -> None:
    """Note on a submission that a chunk of it is on lease."""
    if chunk.kind == "check" and submission.state == "received":
        enter(submission, "checking", at)
    elif submission.state == "queued":
        enter(submission, "running", at)


def stay(session: Session, phases: Sequence[int], at: float) -> None:
    """Let the submissions to phases that are not judged now stay in their states as long as if they began."""
    for state in ACTIVE:
        of_them = (Submission.phase_id.in_(phases), Submission.state == state)
        session.execute(update(Submission).where(*of_them).values(deadline=at + DEADLINES[state]))


def accept(session: Session, submission: Submission, numbers: Sequence[int], at: float) -> None:
    """Queue the trials of a submission that was found to be one; when all are run a sample follows a second time."""
    enter(submission, "queued", at)
    queue.add(session, submission, "trials", in_chunks(numbers))


def in_chunks(numbers: Sequence[int]) -> list[list[int]]:
    """Return numbers of trials in the units in which they are run."""
    return [list(numbers[k : k + CHUNK]) for k in range(0, len(numbers), CHUNK)]


def sample(numbers: Sequence[int]) -> list[int]:
    """Return which trials of a submission are run twice: by chance, so that nobody can know it before."""
    return sorted(secrets.SystemRandom().sample(list(numbers), run_twice(len(numbers))))


def reject(session: Session, submission: Submission, reason: str, at: float) -> None:
    """End a submission that can't be run: its team's fault, yet it costs no quota."""
    queue.drop(session, submission, at)
    submission.costs = False
    enter(submission, "rejected", at, shown(reason, 500), THEIRS)


def fail(session: Session, submission: Submission, reason: str, at: float) -> None:
    """End a submission by a fault of ours, which costs no quota."""
    queue.drop(session, submission, at)
    submission.costs = False
    enter(submission, "failed", at, shown(reason, 500), OURS)


def cancel(session: Session, submission: Submission, at: float) -> None:
    """End a submission as its team wishes; what has not begun to run costs no quota.

    RefusedError if it has ended already.
    """
    if submission.state not in ACTIVE:
        raise RefusedError(f"it is {submission.state} already")
    queue.drop(session, submission, at)
    ran = select(Trial.id).where(Trial.submission_id == submission.id).limit(1)
    submission.costs = submission.state in ("running", "scoring") or session.scalar(ran) is not None
    enter(submission, "cancelled", at, "cancelled by the team", THEIRS)


def record(session: Session, chunk: Chunk, results: Sequence[dict[str, Any]], at: float, hiding: Hiding) -> None:
    """Keep the results of the first trials of a chunk, end its lease, queue the rest, and let the submission go on.

    Parameters
    ----------
    results : sequence of dict
        For each of its trials, or its first, `number`, `row`, `end`, `owner`, `log`, `frames`, `ran` and its replays.
    hiding : Hiding
        Of the phase.

    Raises
    ------
    RefusedError
        If these are not the results of this chunk's trials.
    """
    numbers, left = chunk.numbers[: len(results)], chunk.numbers[len(results) :]
    if not results or [result["number"] for result in results] != numbers:
        raise RefusedError(f"chunk {chunk.id}: results of other trials")
    submission = chunk.submission
    if chunk.kind == "again":
        hashes = {result["number"]: result["frames"] for result in results}
        for trial in _kept(session, submission):
            if trial.number in hashes:
                hiding.keep(trial, {"again": hashes[trial.number]})
    else:
        for result in results:
            named = {name: result[name] for name in ("number", "replay", "own_replay")}
            trial = Trial(submission_id=submission.id, run=chunk.run, **named)
            result_row = {name: result[name] for name in ("row", "end", "owner", "frames", "ran")}
            hiding.keep(trial, result_row, result["log"])
            session.add(trial)
    chunk.numbers = numbers
    queue.finish(session, chunk, at)
    if left:
        queue.add(session, submission, chunk.kind, [left])
    if submission.state in ACTIVE:
        _go_on(session, submission, chunk, at)


def _go_on(session: Session, submission: Submission, chunk: Chunk, at: float) -> None:
    """Let a submission that has come further stay as long again; after its trials comes the sample, then the table."""
    submission.deadline = at + DEADLINES[submission.state]
    if queue.unfinished(session, submission):
        return
    if chunk.kind == "trials":
        numbers = [trial.number for trial in _kept(session, submission)]
        queue.add(session, submission, "again", in_chunks(sample(numbers)))
        return
    enter(submission, "scoring", at)
    submission.phase.version += 1


def trials(session: Session, submission: Submission, hiding: Hiding, *, logs: bool = False) -> Sequence[Trial]:
    """Return the results of a submission's present run, in the order of their numbers; logs are read if asked for."""
    return [hiding.shown(trial, logs=logs) for trial in _kept(session, submission, logs=logs)]


def _kept(session: Session, submission: Submission, *, logs: bool = False) -> Sequence[Trial]:
    """Return the results of a submission's present run as they are kept."""
    of_run = select(Trial).where(Trial.submission_id == submission.id, Trial.run == submission.run)
    read = undefer(Trial.log) if logs else defer(Trial.log, raiseload=True)
    return session.scalars(of_run.order_by(Trial.number).options(read)).all()


def judge_again(session: Session, submission: Submission, numbers: Sequence[int], at: float) -> None:
    """Judge a submission anew, from its trials on; the results so far are kept as those of an earlier run.

    RefusedError if it was rejected, so that there is nothing to run, or has not been checked yet.
    """
    if submission.state == "rejected":
        raise RefusedError("it was rejected: there is nothing to run")
    if submission.content is None:
        raise RefusedError("no worker has checked it: there is nothing to judge again")
    queue.drop(session, submission, at)
    submission.run += 1
    queue.arrive(session, submission.team_id, at)
    accept(session, submission, numbers, at)
