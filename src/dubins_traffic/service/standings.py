"""Tables of places: which submission of a team counts, the ranking of these, and the history of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, cast

import structlog
from sqlalchemy import func, select
from sqlalchemy.orm import Session

from dubins_traffic.competition.competition import Phase as Loaded
from dubins_traffic.competition.judging import Judged
from dubins_traffic.competition.ranking import missing, rank
from dubins_traffic.service import submissions
from dubins_traffic.service.database_tables import Phase, Standing, Submission, Team, Trial
from dubins_traffic.service.hiding import HiddenError, Hiding
from dubins_traffic.service.service import Service

log = structlog.get_logger("dubins_traffic.service")

ANSWERS_A_DAY = 24
"""So often a day at most a table of rounded aggregates is made anew."""
DAY = 86400.0
PAGE = 20
"""Tables on a page of the history."""


def judged(trials: Sequence[Trial], *, logs: bool = False) -> list[Judged]:
    """Return results as the ranking reads them, with their logs if these have been read."""
    return [
        Judged(
            number=trial.number,
            row=trial.row,
            end=trial.end,
            owner=trial.owner,  # pyright: ignore[reportArgumentType]
            log=trial.log if logs else "",
            frames=trial.frames,
            ran=trial.ran,
        )
        for trial in trials
    ]


def counting(session: Session, phase: Phase) -> Mapping[int, Submission]:
    """Return the submission of each team that counts: the one it has named, else the last valid one."""
    submissions_of_phase = select(Submission).where(Submission.phase_id == phase.id, Submission.disqualified == "")
    ended = submissions_of_phase.where(Submission.state.in_(["done", "scoring"]))
    counted: dict[int, Submission] = {}
    for submission in session.scalars(ended.order_by(Submission.named, Submission.received, Submission.id)):
        counted[submission.team_id] = submission
    return counted


def refresh(service: Service) -> None:
    """Rank the phases whose results have changed, and end the submissions that waited for it."""
    scoring = select(Submission.phase_id).where(Submission.state == "scoring")
    with service.database.reading() as session:
        changed = select(Phase).where((Phase.version > Phase.ranked) | Phase.id.in_(scoring))
        due = [row.id for row in session.scalars(changed) if not service.waits_for_key(row)]
    for number in due:
        try:
            _rank_phase(service, number)
        except HiddenError as error:  # the other phases do not wait for one that can't be read
            log.error("a phase can't be ranked", phase=number, error=str(error))


def _rank_phase(service: Service, number: int) -> None:
    """Rank a phase in a reader's session, since it takes its time; nothing is kept that has changed meanwhile."""
    at = service.clock()
    with service.database.reading() as session:
        row = session.get_one(Phase, number)
        waiting = session.scalars(
            select(Submission.id).where(Submission.phase_id == number, Submission.state == "scoring")
        ).all()
        silent = row.shows == "aggregates" and not row.is_closed(at) and not _may_answer(session, row, at)
        version = row.version
        hiding = service.hiding(row)
        places = None if silent or version == row.ranked else table(session, row, service.phase(row), hiding)
    if silent and not waiting:
        return
    with service.database.writing() as session:
        for submission in session.scalars(select(Submission).where(Submission.id.in_(waiting))):
            if submission.state == "scoring":
                submissions.enter(submission, "done", at)
        row = session.get_one(Phase, number)
        if places is not None and row.version == version:
            row.ranked = version
            latest = latest_standing(session, row, hiding)
            if latest is None or latest.places != places:
                made = Standing(phase_id=row.id, at=at, version=version)
                hiding.keep(made, {"places": places})
                session.add(made)


def _may_answer(session: Session, phase: Phase, at: float) -> bool:
    at_last = session.scalar(select(func.max(Standing.at)).where(Standing.phase_id == phase.id))
    return at_last is None or at - at_last >= DAY / ANSWERS_A_DAY


def table(session: Session, row: Phase, phase: Loaded, hiding: Hiding) -> list[dict[str, Any]]:
    """Return the places of a phase as JSON objects, each with its team and submission; incomplete ones are left out.

    Built-in controllers follow, best first: they have no place, and no team's place depends on them.
    """
    entries: dict[bool, dict[str, list[Judged]]] = {False: {}, True: {}}
    whose: dict[str, Submission] = {}
    for team_id, submission in counting(session, row).items():
        results = judged(submissions.trials(session, submission, hiding))
        if not missing(results, phase):
            team = session.get_one(Team, team_id)
            entries[team.baseline][team.name], whose[team.name] = results, submission
    apart: dict[str, Any] = {"place": None, "ties": [], "to_next": None, "to_next_interval": None}
    return [
        {
            **place.to_json(),
            **(apart if baseline else {}),
            "team": whose[place.entry].team_id,
            "submission": whose[place.entry].id,
        }
        for baseline in (False, True)
        for place in rank(entries[baseline], phase)
    ]


def latest_standing(session: Session, phase: Phase, hiding: Hiding) -> Standing | None:
    """Return the newest table of a phase, if there is one."""
    query = select(Standing).where(Standing.phase_id == phase.id).order_by(Standing.id.desc()).limit(1)
    standing = session.scalars(query).first()
    return None if standing is None else hiding.shown(standing)


def history(session: Session, phase: Phase, hiding: Hiding, page: int) -> tuple[list[Standing], bool]:
    """Return a page of the tables of a phase before the latest, newest first, and whether older ones follow."""
    query = select(Standing).where(Standing.phase_id == phase.id).order_by(Standing.id.desc())
    rows = session.scalars(query.offset(1 + page * PAGE).limit(PAGE + 1)).all()
    return [hiding.shown(one) for one in rows[:PAGE]], len(rows) > PAGE


def first_entries(session: Session, phase: Phase, count: int, hiding: Hiding) -> list[int]:
    """Return the numbers of the submissions on the first places."""
    latest = latest_standing(session, phase, hiding)
    places = [] if latest is None else latest.places
    return [place["submission"] for place in places if place["place"] and place["place"] <= count]


def shown_table(phase: Loaded, standing: Standing | None) -> list[dict[str, Any]]:
    """Return a table as participants may see it before the phase closes: rounded, over enough trials."""
    if standing is None:
        return []
    if phase.shows != "aggregates":
        return list(standing.places)
    if len(phase.numbers) < phase.model.least_trials:
        return []
    return [_rounded(place, phase.model.digits) for place in standing.places]


def _rounded(value: Any, digits: int) -> Any:
    if isinstance(value, dict):
        return {name: _rounded(item, digits) for name, item in cast("dict[str, Any]", value).items()}
    if isinstance(value, list):
        return [_rounded(item, digits) for item in cast("list[Any]", value)]
    return round(value, digits) if isinstance(value, float) else value
