"""Submissions beside others, trial by trial, and over time, as far as who asks may see their trials."""

from __future__ import annotations

from typing import Any

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from dubins_traffic.competition.ranking import value
from dubins_traffic.service import receiving, submissions, viewing
from dubins_traffic.service.database import numbered
from dubins_traffic.service.database_tables import Account, Chunk, Phase, Submission, Trial, Worker
from dubins_traffic.service.receiving import UnknownError
from dubins_traffic.service.service import Service

LATELY = 50
"""So many units of work tell how long the next take."""
SHOWN = 40
"""Submissions of a team over which its progress is shown."""


def strip(service: Service, session: Session, submission: Submission) -> list[dict[str, Any]]:
    """Return the trials of a submission as small maps show them, worst first; who asks may see them."""
    metric = service.phase(submission.phase).ranking.metric
    its_trials = submissions.trials(session, submission, service.hiding(submission.phase))
    shown = [_shown(submission, trial, metric) for trial in its_trials]
    return sorted(shown, key=lambda trial: (float(trial["value"]), int(trial["number"])))


def _shown(submission: Submission, trial: Trial, metric: str) -> dict[str, Any]:
    return {
        "submission": submission.id,
        "run": submission.run,
        "number": trial.number,
        "end": trial.end,
        "value": value(trial.row, metric),
        "map": trial.replay is not None,
    }


def rivals(
    service: Service, session: Session, submission: Submission, account: Account | None
) -> list[tuple[int, str]]:
    """Return what somebody may compare a submission with: numbers and names of others whose trials they may see."""
    row, at = submission.phase, service.clock()
    submissions = receiving.submissions_of(session, row, submission.team_id)
    labels = {one.id: f"{one.id}, {one.filename}" for one in submissions if one.state not in ("rejected", "cancelled")}
    _, places = viewing.latest_places(service, session, row, account)
    for place in places:
        other = session.get_one(Submission, place["submission"])
        if viewing.sees_trials(row, account, other, at):
            labels.setdefault(other.id, f"{other.id} of {place['entry']}")
    labels.pop(submission.id, None)
    return list(labels.items())


def beside(service: Service, session: Session, number: int, other: int, account: Account | None) -> dict[str, Any]:
    """Return a submission of somebody's team and another to the same phase, trial by trial.

    The trials in which the other counted the most more come first.

    UnknownError if somebody may not see the trials of both.
    """
    at, pair = service.clock(), [receiving.submission_numbered(session, number, account)]
    rival = numbered(session, Submission, other)
    if rival is None or rival.phase_id != pair[0].phase_id:
        raise UnknownError("no such submission to this phase")
    pair.append(rival)
    if not all(viewing.sees_trials(one.phase, account, one, at) for one in pair):
        raise UnknownError("no such submission, or its trials are not shown now")
    first, second = ({trial["number"]: trial for trial in strip(service, session, one)} for one in pair)
    rows: list[dict[str, Any]] = [
        {"number": k, "first": first[k], "second": second[k], "apart": first[k]["value"] - second[k]["value"]}
        for k in sorted(first.keys() & second.keys())
    ]
    phase = pair[0].phase
    return {
        "pair": [{"id": one.id, "team": one.team.name, "file": one.filename} for one in pair],
        "rows": sorted(rows, key=lambda row: row["apart"]),
        "phase": phase.name,
        "slug": phase.competition.slug,
        "metric": service.phase(phase).ranking.metric,
    }


def progress(service: Service, session: Session, row: Phase, team_id: int) -> list[dict[str, Any]]:
    """Return the latest submissions of a team to a phase that have a mean it may see, oldest first."""
    latest = receiving.submissions_of(session, row, team_id)[:SHOWN]
    documents = [viewing.submission_document(service, session, one, None, {}, logs=False) for one in reversed(latest)]
    return steps(service, row, documents)


def steps(service: Service, row: Phase, documents: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return numbers and means of submissions whose means are shown."""
    metric = service.phase(row).ranking.metric
    ended = [one for one in documents if one["state"] == "done" and one.get("summary")]
    return [{"id": one["id"], "mean": one["summary"][metric]} for one in ended]


def team_places(service: Service, session: Session, account: Account, team_id: int) -> list[dict[str, Any]]:
    """Return the phases to which a team has handed in: its place as far as it is shown, and its progress."""
    entered = select(Submission.phase_id).where(Submission.team_id == team_id)
    listed: list[dict[str, Any]] = []
    for row in session.scalars(select(Phase).where(Phase.id.in_(entered)).order_by(Phase.id.desc())):
        _, places = viewing.latest_places(service, session, row, account)
        place = next((one["place"] for one in places if one["team"] == team_id), None)
        listed.append(
            {
                "slug": row.competition.slug,
                "competition": row.competition.title,
                "phase": row.name,
                "place": place,
                "of": sum(one["place"] is not None for one in places),
                "steps": progress(service, session, row, team_id),
                "metric": service.phase(row).ranking.metric,
            }
        )
    return listed


def replays(
    service: Service, session: Session, row: Phase, places: list[dict[str, Any]], account: Account | None
) -> list[dict[str, Any]]:
    """Return the best trial of the first place and the worst of the last, where somebody may see their trials."""
    ranked = [place for place in places if place["place"] is not None]
    links: list[dict[str, Any]] = []
    for word, place in zip(("best", "worst"), (*ranked[:1], *ranked[-1:]), strict=False):
        submission = session.get_one(Submission, place["submission"])
        if viewing.sees_trials(row, account, submission, service.clock()):
            trial = viewing.extremes(service, session, submission).get(word)
            if trial is not None:
                metric = service.phase(row).ranking.metric
                links.append({"word": word, "entry": place["entry"], **_shown(submission, trial, metric)})
    return links


def wait_of(session: Session, place: int | None, at: float) -> float | None:
    """Return about how long it takes until the unit of work on a place in the queue is done, seconds.

    None if it is on none, no worker is there, or none has done anything yet.
    """
    alive = session.scalar(select(func.count()).where(Worker.seen > at - viewing.ALIVE_S)) or 0
    lately = select(Chunk.took).where(Chunk.took.is_not(None)).order_by(Chunk.id.desc()).limit(LATELY)
    pace = session.scalar(select(func.avg(lately.subquery().c.took)))
    return None if place is None or not alive or pace is None else place * float(pace) / alive


def timeline(rows: list[Phase], at: float) -> dict[str, Any]:
    """Return where phases begin and end on a line of dates, and where now is, in per cent of it."""
    dates = [date for row in rows for date in (row.opens, row.closes) if date is not None]
    first, last = min([*dates, at]), max([*dates, at])
    margin = 0.03 * (last - first) or 1.0
    first, last = first - margin, last + margin

    def place(date: float | None, otherwise: float) -> float:
        return otherwise if date is None else 100.0 * (date - first) / (last - first)

    bars = {row.name: (place(row.opens, 0.0), place(row.closes, 100.0)) for row in rows}
    return {"bars": bars, "now": place(at, 0.0)}
