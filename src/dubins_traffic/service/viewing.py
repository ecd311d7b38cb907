"""What each viewer may see of phases, submissions and trials. Pages and the API show what these functions return."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from dubins_traffic.competition.ranking import value
from dubins_traffic.competition.visibility import SubmissionState, visible
from dubins_traffic.service import standings, submissions
from dubins_traffic.service.accounts import ORGANISER
from dubins_traffic.service.database_tables import (
    Account,
    Announcement,
    Chunk,
    Competition,
    Phase,
    Standing,
    Submission,
    Trial,
    Worker,
)
from dubins_traffic.service.service import Service

ALIVE_S = 120.0
"""A worker that was heard of within so many seconds is there."""


def iso(at: float | None) -> str | None:
    """Return a time as ISO 8601 in UTC, to the second."""
    return None if at is None else datetime.fromtimestamp(at, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def organises(account: Account | None, competition_id: int) -> bool:
    """Whether somebody may see everything of a competition."""
    if account is None or account.role != ORGANISER:
        return False
    return account.competition_id in (None, competition_id)


def owns(account: Account | None, submission: Submission) -> bool:
    """Whether a submission is of somebody's team, or somebody is an organiser."""
    if account is None:
        return False
    return organises(account, submission.phase.competition_id) or account.team_id == submission.team_id


def sees_table(row: Phase, account: Account | None, at: float) -> bool:
    """Whether somebody may see the table of a phase now."""
    return row.shows != "nothing" or row.is_closed(at) or organises(account, row.competition_id)


def sees_trials(row: Phase, account: Account | None, submission: Submission, at: float) -> bool:
    """Whether somebody may see the trials of a submission and their replays now."""
    if organises(account, row.competition_id):
        return True
    if row.shows != "all" and not row.is_closed(at):
        return False
    return owns(account, submission) or (row.is_closed(at) and submission.state == "done")


def shared(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return what others see of a result: how it ended and was scored, without words, which may quote a controller."""
    return {**row, "reason": None}


def replay_of(trial: Trial, submission: Submission, account: Account | None) -> str | None:
    """Return which replay of a trial somebody may see: with the controller's words, if they own them."""
    return (owns(account, submission) and trial.own_replay) or trial.replay


def news(session: Session, row: Competition) -> list[Announcement]:
    """Return the announcements of a competition, newest first."""
    of_it = select(Announcement).where(Announcement.competition_id == row.id)
    return list(session.scalars(of_it.order_by(Announcement.id.desc())))


def latest_places(
    service: Service, session: Session, row: Phase, account: Account | None
) -> tuple[float | None, list[dict[str, Any]]]:
    """Return when the latest table of a phase was made, and its places as somebody may see them now."""
    if not sees_table(row, account, service.clock()) or service.waits_for_key(row):
        return None, []
    latest = standings.latest_standing(session, row, service.hiding(row))
    return latest and latest.at, _places_in(service, row, latest, account)


def past_places(
    service: Service, session: Session, row: Phase, account: Account | None, page: int
) -> tuple[list[tuple[float, list[dict[str, Any]]]], bool]:
    """Return a page of the tables before the latest as somebody may see them, and whether older ones follow."""
    if not sees_table(row, account, service.clock()):
        return [], False
    past, older = standings.history(session, row, service.hiding(row), page)
    return [(one.at, _places_in(service, row, one, account)) for one in past], older


def _places_in(
    service: Service, row: Phase, standing: Standing | None, account: Account | None
) -> list[dict[str, Any]]:
    """Return a table of a phase that somebody may see now: whole or rounded, or nothing if there is none yet."""
    if standing is None:
        return []
    whole = organises(account, row.competition_id) or row.is_closed(service.clock())
    return list(standing.places) if whole else standings.shown_table(service.phase(row), standing)


def competition_document(service: Service, row: Competition) -> dict[str, Any]:
    """Return a competition for everybody."""
    at, loaded = service.clock(), service.competition(row)
    return {
        "address": row.slug,
        "title": row.title,
        "about": loaded.model.about,
        "pages": loaded.model.pages,
        "phases": [phase_document(service, phase, at) for phase in row.phases],
    }


def phase_document(service: Service, row: Phase, at: float) -> dict[str, Any]:
    """Return a phase for everybody."""
    phase = service.phase(row)
    return {
        "name": row.name,
        "shows": row.shows,
        "opens": iso(row.opens),
        "closes": iso(row.closes),
        "state": "closed" if row.is_closed(at) else "open" if row.is_open(at) else "to come",
        "trials": len(phase.numbers),
        "limits": phase.model.limits.model_dump(),
        "quota": phase.quota.model_dump(),
        "ranking": phase.ranking.model_dump(),
        "commitment": row.commitment,
        "revealed": iso(row.revealed),
        "waits_for_key": service.waits_for_key(row),
    }


def submission_document(
    service: Service,
    session: Session,
    submission: Submission,
    account: Account | None,
    places: Mapping[int, int],
    *,
    logs: bool = True,
) -> dict[str, Any]:
    """Return what somebody may see of a submission, with or without logs; the team of it and organisers get here."""
    row = submission.phase
    logs = logs or row.shows == "aggregates"
    place = places.get(submission.id) if submission.state in ("received", "queued") else None
    state = SubmissionState(
        submission.state,  # pyright: ignore[reportArgumentType]
        submission.reason,
        submission.fault or None,  # pyright: ignore[reportArgumentType]
        iso(submission.received),
        place,
    )
    trials: Sequence[Trial] = ()
    if not service.waits_for_key(row):
        trials = submissions.trials(session, submission, service.hiding(row), logs=logs)
    results = standings.judged(trials, logs=logs)
    now = datetime.fromtimestamp(service.clock(), UTC)
    phase = service.phase(row)
    if organises(account, row.competition_id):
        open_model = phase.model.model_copy(update={"shows": "all"})
        phase = type(phase)(phase.name, open_model, phase.configurations, phase.ranking, phase.folder)
    secret = phase.shows == "nothing" and not phase.is_closed(now)
    return {
        "id": submission.id,
        "competition": row.competition.slug,
        "team": submission.team.name,
        "file": submission.filename,
        "digest": submission.digest,
        "named": submission.named,
        "disqualified": submission.disqualified,
        "active": submission.state in submissions.ACTIVE,
        **visible(phase, state, results, now=now),
        "shows": row.shows,
        "deadline": iso(submission.deadline) if submission.state in submissions.ACTIVE and not secret else None,
    }


def differing(service: Service, session: Session, submission: Submission) -> list[int]:
    """Return the trials whose frames were others when they were run a second time."""
    trials = submissions.trials(session, submission, service.hiding(submission.phase))
    return [trial.number for trial in trials if trial.again is not None and trial.again != trial.frames]


def trial_of(service: Service, session: Session, submission: Submission, number: int) -> Trial | None:
    """Return the result of a trial of a submission's present run, its log with it."""
    query = select(Trial).where(
        Trial.submission_id == submission.id, Trial.run == submission.run, Trial.number == number
    )
    trial = session.scalars(query).first()
    return None if trial is None else service.hiding(submission.phase).shown(trial, logs=True)


def extremes(service: Service, session: Session, submission: Submission) -> dict[str, Trial]:
    """Return the trials of a submission with a replay that count the most and the least, as ``best`` and ``worst``."""
    metric = service.phase(submission.phase).ranking.metric
    its_trials = submissions.trials(session, submission, service.hiding(submission.phase))
    ranked = sorted((one for one in its_trials if one.replay), key=lambda trial: value(trial.row, metric))
    return {"best": ranked[-1], "worst": ranked[0]} if ranked else {}


def status_document(service: Service, session: Session) -> dict[str, Any]:
    """Return how long the queue is and how many workers there are, for everybody."""
    at = service.clock()
    counts = session.execute(
        select(Chunk.state, func.count()).where(Chunk.state.in_(["waiting", "leased"])).group_by(Chunk.state)
    )
    by_state = {row[0]: row[1] for row in counts}
    alive = session.scalar(select(func.count()).where(Worker.seen > at - ALIVE_S)) or 0
    return {
        "time": iso(at),
        "waiting": by_state.get("waiting", 0),
        "running": by_state.get("leased", 0),
        "workers": alive,
        "teams_waiting": len(set(session.scalars(select(Chunk.team_id).where(Chunk.state == "waiting")))),
    }


def workers(session: Session) -> list[Worker]:
    """Return all workers that have ever asked for work, those heard of last first."""
    return list(session.scalars(select(Worker).order_by(Worker.seen.desc()).limit(100)))
