"""The queue: chunks of trials on lease to workers, team after team. It lies in the tables of what it is about.

Every function works in a writer's session of its caller, so what it does commits together with what follows from it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from sqlalchemy import func, or_, select, update
from sqlalchemy.orm import Session

from dubins_traffic.errors import DubinsTrafficError
from dubins_traffic.service.database_tables import Chunk, Submission, Team

ATTEMPTS = 5
"""So many leases of a chunk may end without a result; then its submission fails, by our fault."""

LARGEST = 2**31 - 1
"""The largest number of a row."""
FIRST_PAUSE_S = 0.5
"""Half of how long a chunk waits after the first lease without a result, seconds; twice as long after the next."""


class StaleLeaseError(DubinsTrafficError):
    """A worker reports on a lease that it has lost."""


def add(session: Session, submission: Submission, kind: str, chunks: Sequence[Sequence[int]]) -> None:
    """Queue work on a submission, a chunk for each list of numbers of trials."""
    for numbers in chunks:
        session.add(
            Chunk(
                submission_id=submission.id,
                team_id=submission.team_id,
                run=submission.run,
                kind=kind,
                numbers=list(numbers),
                state="waiting",
            )
        )
    session.flush()


def take(session: Session, worker: str, at: float, seconds: float) -> Chunk | None:
    """Lease the chunk that is next to a worker, for so many seconds; None if nothing waits.

    Next is the team that was served longest ago; of its chunks checks come first, then the oldest.
    """
    order = (Team.turn, Chunk.team_id, Chunk.kind != "check", Chunk.id)
    due = or_(Chunk.leased_until.is_(None), Chunk.leased_until <= at)
    waiting = select(Chunk).join(Team, Team.id == Chunk.team_id).where(Chunk.state == "waiting", due)
    chunk = session.scalars(waiting.order_by(*order).limit(1)).first()
    if chunk is None:
        return None
    latest = session.scalar(select(func.max(Team.turn))) or 0
    session.execute(update(Team).where(Team.id == chunk.team_id).values(turn=latest + 1))
    chunk.state = "leased"
    chunk.token += 1
    chunk.attempts += 1
    chunk.worker = worker
    chunk.leased_until = at + seconds
    session.flush()
    return chunk


def held(session: Session, chunk_id: int, token: int) -> Chunk:
    """Return the chunk that is on lease under a token.

    StaleLeaseError if the lease has ended: it ran out and another has it, or the work was cancelled.
    """
    chunk = session.get(Chunk, chunk_id) if chunk_id <= LARGEST else None
    if chunk is None or chunk.state != "leased" or chunk.token != token:
        raise StaleLeaseError(f"chunk {chunk_id}: the lease {token} has ended")
    return chunk


def finish(session: Session, chunk: Chunk) -> None:
    """End a lease with its work done."""
    chunk.state, chunk.leased_until, chunk.note = "done", None, ""
    session.flush()


def release(session: Session, chunk: Chunk, note: str, at: float, *, worker_left: bool = False) -> bool:
    """End a lease without a result, and let the chunk wait again; after each such end twice as long.

    Parameters
    ----------
    worker_left : bool
        The worker gave it back in order; this attempt is not counted.

    Returns
    -------
    bool
        False if it has been tried too often, and is given up.
    """
    chunk.attempts -= int(worker_left)
    chunk.leased_until, chunk.note = (None if worker_left else at + FIRST_PAUSE_S * 2.0**chunk.attempts), note
    chunk.state = "waiting" if chunk.attempts < ATTEMPTS else "failed"
    session.flush()
    return chunk.state == "waiting"


def overdue(session: Session, at: float) -> Sequence[Chunk]:
    """Return the chunks whose lease has run out."""
    return session.scalars(select(Chunk).where(Chunk.state == "leased", Chunk.leased_until < at)).all()


def renew(session: Session, until: float) -> None:
    """Let all leases hold until a time at least."""
    held_now = (Chunk.state == "leased", Chunk.leased_until < until)
    session.execute(update(Chunk).where(*held_now).values(leased_until=until))


def drop(session: Session, submission: Submission) -> None:
    """Take all work on a submission out of the queue; who holds a lease of it finds it ended."""
    open_states = Chunk.state.in_(["waiting", "leased"])
    session.execute(
        update(Chunk).where(Chunk.submission_id == submission.id, open_states).values(state="dropped")
    )


def unfinished(session: Session, submission: Submission) -> int:
    """Return how many chunks of a submission's present run are not done."""
    query = select(func.count()).where(
        Chunk.submission_id == submission.id,
        Chunk.run == submission.run,
        Chunk.state.in_(["waiting", "leased"]),
    )
    return session.scalar(query) or 0


def places(session: Session) -> Mapping[int, int]:
    """Return how many chunks are served until the first of each submission that waits, this included."""
    rows = session.execute(
        select(Chunk.submission_id, Chunk.team_id, Team.turn)
        .join(Team, Team.id == Chunk.team_id)
        .where(Chunk.state == "waiting")
        .order_by(Chunk.kind != "check", Chunk.id)
    ).all()
    many = Counter(row.team_id for row in rows)
    turns = {row.team_id: (row.turn, row.team_id) for row in rows}
    before: Counter[int] = Counter()
    places_ahead: dict[int, int] = {}
    for submission_id, team_id, _ in rows:
        ahead = before[team_id]
        before[team_id] += 1
        if submission_id not in places_ahead:
            others = sum(
                min(many[other], ahead + (turns[other] < turns[team_id]))
                for other in many
                if other != team_id
            )
            places_ahead[submission_id] = ahead + others + 1
    return places_ahead
