"""Taking in submissions, and what their teams do with them: cancel, and name the one that counts."""

from __future__ import annotations

import hashlib

from sqlalchemy import select, update
from sqlalchemy.orm import Session

from dubins_traffic.errors import DubinsTrafficError
from dubins_traffic.service import submissions, viewing
from dubins_traffic.service.accounts import WrongEntryError
from dubins_traffic.service.database import numbered
from dubins_traffic.service.database_tables import Account, Competition, Phase, Submission
from dubins_traffic.service.service import Service, competition_of, phase_of
from dubins_traffic.service.submissions import RefusedError, Upload


class UnknownError(DubinsTrafficError):
    """There is no such thing, or not for who asks."""


def competition_named(session: Session, slug: str) -> Competition:
    """Return a competition; UnknownError if there is none."""
    competition = competition_of(session, slug)
    if competition is None:
        raise UnknownError("no such competition")
    return competition


def phase_named(session: Session, slug: str, name: str) -> Phase:
    """Return a phase; UnknownError if there is none."""
    phase = phase_of(session, slug, name)
    if phase is None:
        raise UnknownError("no such phase")
    return phase


def submission_numbered(session: Session, number: int, account: Account | None) -> Submission:
    """Return a submission of somebody's team; UnknownError if there is none, or it is another team's."""
    submission = numbered(session, Submission, number)
    if submission is None or not viewing.owns(account, submission):
        raise UnknownError("no such submission")
    return submission


def take_in(service: Service, account: Account, slug: str, name: str, filename: str, data: bytes) -> tuple[int, bool]:
    """Keep what somebody has sent and queue it; the same again is the same submission.

    The bytes are in the store before a row names them, so a server that is killed in between loses nothing that it
    has confirmed. What is refused is not kept.

    Returns
    -------
    tuple of int and bool
        Number of the submission, and whether it is new.

    Raises
    ------
    RefusedError, UnknownError, WrongEntryError
        If the phase is not open, there is none, the quota is used up, or nothing was sent.
    """
    if not data:
        raise WrongEntryError("file: empty; choose a controller in Python, a zip archive or a program")
    if len(data) > service.settings.largest_upload << 20:
        raise WrongEntryError(f"file: at most {service.settings.largest_upload} MiB")
    at = service.clock()
    upload = Upload(hashlib.sha256(data).hexdigest(), filename or "upload", len(data))
    with service.database.reading() as session:
        phase = phase_named(session, slug, name)
        submissions.admitted(session, phase, service.phase(phase).quota, account, upload, at)
    service.storage.put(data, "submissions")

    def keep(session: Session) -> tuple[int, bool]:
        row = phase_named(session, slug, name)
        member = session.get_one(Account, account.id)
        submission, new = submissions.receive(session, row, service.phase(row).quota, member, upload, at)
        return submission.id, new

    return service.database.patiently(keep)


def cancel(service: Service, account: Account, number: int) -> None:
    """Cancel a submission of somebody's team; RefusedError if it has ended."""

    def end(session: Session) -> None:
        submissions.cancel(session, submission_numbered(session, number, account), service.clock())

    service.database.patiently(end)


def name_it(service: Service, account: Account, number: int) -> None:
    """Let a submission be the one of its team that counts in its phase.

    RefusedError if the phase is over, or the submission was rejected or cancelled.
    """

    def choose(session: Session) -> None:
        submission = submission_numbered(session, number, account)
        if submission.team_id != account.team_id:
            raise RefusedError("only its team may name it")
        if submission.phase.is_closed(service.clock()):
            raise RefusedError("the phase is closed")
        if submission.state in ("rejected", "cancelled"):
            raise RefusedError(f"it is {submission.state}")
        its_team = update(Submission).where(
            Submission.phase_id == submission.phase_id, Submission.team_id == submission.team_id
        )
        session.execute(its_team.values(named=False))
        submission.named = True
        submission.phase.version += 1

    service.database.patiently(choose)


def submissions_of(session: Session, phase: Phase, team_id: int | None) -> list[Submission]:
    """Return the submissions of a team to a phase, newest first; of all teams if none is given."""
    query = select(Submission).where(Submission.phase_id == phase.id)
    if team_id is not None:
        query = query.where(Submission.team_id == team_id)
    return list(session.scalars(query.order_by(Submission.id.desc())))
