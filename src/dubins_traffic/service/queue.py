"""The queue: chunks of trials on lease to workers, team after team. It lies in the tables of what it is about.

Teams are charged the seconds for which workers work for them, and who has had the fewest is next: neither many chunks
nor slow ones gain a team more than its share. Who was idle begins with as much as those who are not, and saves nothing.

Every function works in a writer's session of its caller, so what it does commits together with what follows from it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from sqlalchemy import func, or_, select, update
from sqlalchemy.orm import Session

from dubins_traffic.errors import DubinsTrafficError
from dubins_traffic.service.database import numbered
from dubins_traffic.service.database_tables import Chunk, Submission, Team

ATTEMPTS = 5
"""So many leases of a chunk may end without a result; then its submission fails, by our fault."""

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


def take(session: Session, worker: str, at: float, seconds: float, unjudged: Sequence[int] = ()) -> Chunk | None:
    """Lease the chunk that is next to a worker, for so many seconds; None if nothing waits.

    Of the phases `unjudged` submissions are checked alone.

    Next is the team for which workers have worked the least; of its chunks checks come first, then what is run again,
    so that a submission is finished before the next is begun, then the oldest.
    """
    due = [Chunk.state == "waiting", or_(Chunk.leased_until.is_(None), Chunk.leased_until <= at)]
    if unjudged:
        waits = select(Submission.id).where(Submission.phase_id.in_(unjudged))
        due.append(or_(Chunk.kind == "check", Chunk.submission_id.not_in(waits)))
    teams = session.scalars(select(Chunk.team_id).where(*due).distinct()).all()
    if not teams:
        return None
    charged = _charged(session, at)
    team = min(teams, key=lambda number: charged[number])
    order = (Chunk.kind != "check", Chunk.kind != "again", Chunk.id)
    query = select(Chunk).where(Chunk.team_id == team, *due).order_by(*order).limit(1)
    chunk = session.scalars(query).one()
    chunk.state = "leased"
    chunk.leased_at = at
    chunk.token += 1
    chunk.attempts += 1
    chunk.worker = worker
    chunk.leased_until = at + seconds
    session.flush()
    return chunk


def arrive(session: Session, team_id: int, at: float) -> None:
    """Let a team without work in the queue begin level with the waiting team that has been served least.

    So a team gains no turns by staying away. `at` is the time, seconds since 1970.
    """
    charged = _charged(session, at)
    if team_id not in charged:
        most = session.scalar(select(func.max(Team.turn))) or 0.0
        least = min((seconds for seconds, _, _ in charged.values()), default=most)
        team = session.get_one(Team, team_id)
        team.turn = max(team.turn, least)


def _charged(session: Session, at: float) -> Mapping[int, tuple[float, int, int]]:
    """Return what orders the teams that have work in the queue: seconds of workers so far, leases now, number."""
    in_queue = select(Chunk.team_id).where(Chunk.state.in_(["waiting", "leased"]))
    teams = session.execute(select(Team.id, Team.turn).where(Team.id.in_(in_queue))).all()
    leases: dict[int, list[float]] = {}
    leased = select(Chunk.team_id, Chunk.leased_at).where(Chunk.state == "leased")
    for team_id, since in session.execute(leased).all():
        leases.setdefault(team_id, []).append(max(0.0, at - (at if since is None else since)))
    return {number: (turn + sum(leases.get(number, ())), len(leases.get(number, ())), number) for number, turn in teams}


def _charge(session: Session, chunk: Chunk, at: float) -> None:
    """Charge a team with a lease that ends, whatever came of it."""
    if chunk.state == "leased" and chunk.leased_at is not None:
        session.get_one(Team, chunk.team_id).turn += max(0.0, at - chunk.leased_at)
    chunk.leased_at = None


def held(session: Session, chunk_id: int, token: int) -> Chunk:
    """Return the chunk that is on lease under a token.

    StaleLeaseError if the lease has ended: it ran out and another has it, or the work was cancelled.
    """
    chunk = numbered(session, Chunk, chunk_id)
    if chunk is None or chunk.state != "leased" or chunk.token != token:
        raise StaleLeaseError(f"chunk {chunk_id}: the lease {token} has ended")
    return chunk


def finish(session: Session, chunk: Chunk, at: float) -> None:
    """End a lease with its work done."""
    chunk.took = None if chunk.leased_at is None else max(0.0, at - chunk.leased_at)
    _charge(session, chunk, at)
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
    _charge(session, chunk, at)
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


def drop(session: Session, submission: Submission, at: float) -> None:
    """Take all work on a submission out of the queue; who holds a lease of it finds it ended."""
    of_it = Chunk.submission_id == submission.id
    for chunk in session.scalars(select(Chunk).where(of_it, Chunk.state == "leased")):
        _charge(session, chunk, at)
    session.flush()
    session.execute(update(Chunk).where(of_it, Chunk.state.in_(["waiting", "leased"])).values(state="dropped"))


def unfinished(session: Session, submission: Submission) -> int:
    """Return how many chunks of a submission's present run are not done."""
    query = select(func.count()).where(
        Chunk.submission_id == submission.id,
        Chunk.run == submission.run,
        Chunk.state.in_(["waiting", "leased"]),
    )
    return session.scalar(query) or 0


def places(session: Session, at: float) -> Mapping[int, int]:
    """Return how many chunks are served until the first of each submission that waits, this included.

    It is told as if all chunks took the same time.
    """
    rows = session.execute(
        select(Chunk.submission_id, Chunk.team_id)
        .where(Chunk.state == "waiting")
        .order_by(Chunk.kind != "check", Chunk.kind != "again", Chunk.id)
    ).all()
    many = Counter(row.team_id for row in rows)
    turns = _charged(session, at)
    before: Counter[int] = Counter()
    places_ahead: dict[int, int] = {}
    for submission_id, team_id in rows:
        ahead = before[team_id]
        before[team_id] += 1
        if submission_id not in places_ahead:
            others = sum(
                min(many[other], ahead + (turns[other] < turns[team_id])) for other in many if other != team_id
            )
            places_ahead[submission_id] = ahead + others + 1
    return places_ahead
