"""What the service does by itself: leases that ran out, deadlines that passed, new tables, the podium run again."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial

import structlog
from sqlalchemy import select
from sqlalchemy.exc import DBAPIError
from sqlalchemy.orm import Session

from dubins_traffic.service import organising, queue, standings, submissions
from dubins_traffic.service.database_tables import Phase, Submission
from dubins_traffic.service.hiding import Hiding
from dubins_traffic.service.service import Service

PAUSE_S = 1.0
PODIUM = 3
"""Entries whose every trial is run a second time after the phase has closed."""
log = structlog.get_logger("dubins_traffic.service")


def end_silent(service: Service, *, was_away: bool = False) -> None:
    """End leases that have run out, and submissions whose deadline has passed.

    Parameters
    ----------
    was_away : bool
        The service or its database was away until now, for some writers at least. Workers could not renew their
        leases then, so all leases begin anew.
    """
    with service.database.writing() as session:
        if was_away:
            queue.renew(session, service.clock() + service.settings.lease)
        end_leases(session, service.clock())
        unjudged = [row.id for row in service.waiting_for_key(session)]
        if unjudged:
            submissions.stay(session, unjudged, service.clock())
        end_overdue(session, service.clock())


def end_leases(session: Session, at: float) -> None:
    """Let chunks wait again whose workers were silent too long."""
    for chunk in queue.overdue(session, at):
        log.warning("lease ran out", chunk=chunk.id, worker=chunk.worker, attempt=chunk.attempts)
        give_back(session, chunk.id, f"worker {chunk.worker} fell silent", at)


def give_back(session: Session, chunk_id: int, why: str, at: float) -> None:
    """End a lease without a result; a chunk that was tried too often ends its submission by our fault."""
    chunk = session.get_one(queue.Chunk, chunk_id)
    if not queue.release(session, chunk, why, at) and chunk.submission.state in submissions.ACTIVE:
        submissions.fail(session, chunk.submission, f"tried {chunk.attempts} times: {why}", at)


def end_overdue(session: Session, at: float) -> None:
    """End submissions that stayed in a state for too long: that is our fault."""
    late = select(Submission).where(Submission.state.in_(submissions.ACTIVE), Submission.deadline < at)
    for submission in session.scalars(late).all():
        log.error("deadline passed", submission=submission.id, state=submission.state)
        submissions.fail(session, submission, f"stayed {submission.state} for too long", at)


def check_podiums(service: Service) -> None:
    """Queue all trials of the first entries of phases that have closed a second time, once."""
    with service.database.writing() as session:
        due = select(Phase).where(
            Phase.closes <= service.clock(), Phase.podium_checked.is_(False), Phase.shows != "all"
        )
        for phase in session.scalars(due).all():
            if service.waits_for_key(phase):
                continue
            active = Submission.state.in_(submissions.ACTIVE)
            busy = session.scalars(select(Submission.id).where(Submission.phase_id == phase.id, active).limit(1))
            if busy.first() is None and phase.ranked >= phase.version:
                _run_podium_again(session, phase, service.hiding(phase), service.clock())


def _run_podium_again(session: Session, phase: Phase, hiding: Hiding, at: float) -> None:
    for number in standings.first_entries(session, phase, PODIUM, hiding):
        submission = session.get_one(Submission, number)
        its_trials = submissions.trials(session, submission, hiding)
        left = [trial.number for trial in its_trials if trial.again is None]
        queue.arrive(session, submission.team_id, at)
        queue.add(session, submission, "again", submissions.in_chunks(left))
    phase.podium_checked = True


STEPS = (organising.publish_opened, standings.refresh, check_podiums)
"""What is due again and again; each step may be taken twice, and does not wait for another that fails."""


def sweep(service: Service, *, was_away: bool = False) -> bool:
    """Take every step; one that fails is told of and taken again the next time.

    Returns
    -------
    bool
        Whether leases could be looked after; if not, the next sweep is told that the service `was_away`.
    """
    looked_after = _taken(service, partial(end_silent, was_away=was_away), "end_silent")
    for step in STEPS:
        _taken(service, step, step.__name__)
    return looked_after


def _taken(service: Service, step: Callable[[Service], None], name: str) -> bool:
    """Take a step, and return whether it was taken."""
    try:
        step(service)
    except DBAPIError as error:
        log.warning("the database is away", step=name, error=str(error.orig))
        return False
    except Exception:
        log.exception("housekeeping failed", step=name)
        return False
    return True


class Housekeeper(threading.Thread):
    """Sweeps every second until it is told to stop; a database that is away is waited for."""

    def __init__(self, service: Service) -> None:
        super().__init__(name="housekeeper", daemon=True)
        self._service = service
        self._stop_asked = threading.Event()
        self._looked_after = False

    def run(self) -> None:
        """Sweep until told to stop."""
        while not self._stop_asked.wait(PAUSE_S):
            self.sweep()

    def sweep(self) -> None:
        """Sweep once; leases begin anew if the last sweep, or a writer since then, has found the database away."""
        was_away = self._service.database.was_away() or not self._looked_after
        self._looked_after = sweep(self._service, was_away=was_away)

    def stop(self) -> None:
        """End the sweeping, and wait for the last."""
        self._stop_asked.set()
        self.join(timeout=30)
