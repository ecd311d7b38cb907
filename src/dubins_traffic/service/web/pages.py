"""Pages that everybody may open: competitions, phases, tables, the state of the queue, replays."""

from __future__ import annotations

from collections.abc import Sequence

from litestar import Controller, MediaType, Response, get
from litestar.exceptions import NotFoundException
from litestar.params import FromPath
from litestar.response import Template
from sqlalchemy import select

from dubins_traffic.competition import sealing
from dubins_traffic.service import receiving, standings, submissions, viewing
from dubins_traffic.service.hiding import replays_of
from dubins_traffic.service.office import Office, competition_of
from dubins_traffic.service.receiving import UnknownError
from dubins_traffic.service.tables import Competition, Standing, Submission, Trial
from dubins_traffic.service.web.said import page
from dubins_traffic.service.web.viewer import OfficeHere, Viewer, ViewerHere

REPLAY_POLICY = (
    "sandbox allow-scripts; default-src 'none'; img-src data:; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
)
"""Beside the policy that the page of a replay has of itself, which names its one script by its hash."""


class Pages(Controller):
    """What everybody may read."""

    include_in_schema = False

    @get("/", sync_to_thread=True)
    def home(self, office: OfficeHere, viewer: ViewerHere) -> Template:
        """Show all competitions."""
        with office.database.reading() as session:
            rows = session.scalars(select(Competition).order_by(Competition.id.desc())).all()
            told = [viewing.told_competition(office, row) for row in rows]
        return page(office, viewer, "home", "Competitions", competitions=told)

    @get("/c/{slug:str}", sync_to_thread=True)
    def competition(self, office: OfficeHere, viewer: ViewerHere, slug: FromPath[str]) -> Template:
        """Show a competition and its phases."""
        with office.database.reading() as session:
            row = competition_of(session, slug)
            if row is None:
                raise NotFoundException("no such competition")
            told = viewing.told_competition(office, row)
        return page(office, viewer, "competition", told["title"], competition=told)

    @get("/c/{slug:str}/{name:str}", sync_to_thread=True)
    def phase(
        self, office: OfficeHere, viewer: ViewerHere, slug: FromPath[str], name: FromPath[str]
    ) -> Template:
        """Show a phase: rules, limits, the form to submit, the own submissions."""
        at, account = office.clock(), viewer.account
        with office.database.reading() as session:
            row = receiving.found_phase(session, slug, name)
            told, own, used = viewing.told_phase(office, row, at), [], None
            if account is not None and account.team_id is not None:
                places = viewing.places_of(session)
                found = receiving.submissions_of(session, row, account.team_id)
                own = [
                    viewing.told_submission(office, session, one, None, places, logs=False) for one in found
                ]
                used = submissions.used(session, row, account.team_id, at)
            title = row.competition.title
        given = {"phase": told, "own": own, "used": used, "slug": slug, "competition": title}
        return page(
            office, viewer, "phase", f"{title}: {name}", largest=office.settings.largest_upload, **given
        )

    @get("/c/{slug:str}/{name:str}/table", sync_to_thread=True)
    def table(
        self, office: OfficeHere, viewer: ViewerHere, slug: FromPath[str], name: FromPath[str]
    ) -> Template:
        """Show the leaderboard of a phase and its history."""
        at = office.clock()
        with office.database.reading() as session:
            row = receiving.found_phase(session, slug, name)
            phase, told = office.phase(row), viewing.told_phase(office, row, at)
            sees = viewing.sees_table(row, viewer.account, at)
            every: Sequence[Standing] = standings.history(session, row, office.hiding(row)) if sees else ()
            whole = row.is_closed(at) or viewer.organiser
            tables = [
                (one.at, list(one.places) if whole else standings.shown_table(phase, one)) for one in every
            ]
            title = row.competition.title
        given = {"phase": told, "slug": slug, "competition": title, "sees": sees}
        latest = tables[-1] if tables else None
        past = tables[-21:-1][::-1]
        return page(office, viewer, "table", f"{title}: {name}: table", latest=latest, past=past, **given)

    @get("/c/{slug:str}/{name:str}/commitment.json", sync_to_thread=True)
    def commitment(self, office: OfficeHere, slug: FromPath[str], name: FromPath[str]) -> Response[str]:
        """Return the published commitment to secret seeds."""
        with office.database.reading() as session:
            row = receiving.found_phase(session, slug, name)
            if row.commitment is None:
                raise NotFoundException("no commitment has been published")
            path = sealing.commitment_path(office.phase(row))
        return Response(path.read_text(encoding="utf-8"), media_type=MediaType.JSON)

    @get("/c/{slug:str}/{name:str}/seeds.txt", sync_to_thread=True)
    def seeds(self, office: OfficeHere, slug: FromPath[str], name: FromPath[str]) -> Response[str]:
        """Return the revealed seeds."""
        with office.database.reading() as session:
            row = receiving.found_phase(session, slug, name)
            if row.revealed is None:
                raise NotFoundException("the seeds are not revealed")
            path = sealing.revealed_path(office.phase(row))
        return Response(path.read_text(encoding="utf-8"), media_type=MediaType.TEXT)

    @get("/s/{number:int}/trials/{trial:int}", sync_to_thread=True)
    def trial(
        self, office: OfficeHere, viewer: ViewerHere, number: FromPath[int], trial: FromPath[int]
    ) -> Template:
        """Show a trial: its score, its log, its replay."""
        with office.database.reading() as session:
            submission, found = _seen(office, viewer, number, trial, session)
            own = viewing.owns(viewer.account, submission)
            row = found.row if own else viewing.shared(found.row)
            given = {
                "submission": submission,
                "team": submission.team.name,
                "trial": found,
                "row": row,
                "phase": submission.phase.name,
                "slug": submission.phase.competition.slug,
                "own": own,
                "of": len(office.phase(submission.phase).numbers),
            }
        return page(office, viewer, "trial", f"Trial {trial} of submission {number}", **given)

    @get("/s/{number:int}/trials/{trial:int}/replay", sync_to_thread=True)
    def replay(
        self, office: OfficeHere, viewer: ViewerHere, number: FromPath[int], trial: FromPath[int]
    ) -> Response[bytes]:
        """Return the page that replays a trial, for a frame that may do nothing but draw."""
        with office.database.reading() as session:
            submission, found = _seen(office, viewer, number, trial, session)
            hiding = office.hiding(submission.phase)
            digest = viewing.replay_of(found, submission, viewer.account)
        if digest is None:
            raise NotFoundException("this trial has no replay")
        headers = {"content-encoding": "gzip", "content-security-policy": REPLAY_POLICY}
        data = hiding.show(office.storage.get(digest, "replays"), replays_of(found))
        return Response(data, media_type="text/html; charset=utf-8", headers=headers)

    @get("/status", sync_to_thread=True)
    def status(self, office: OfficeHere, viewer: ViewerHere) -> Template:
        """Show the queue and the workers."""
        with office.database.reading() as session:
            told = viewing.told_status(office, session)
            workers = viewing.workers(session) if viewer.organiser else []
        return page(office, viewer, "status", "Queue and workers", status=told, workers=workers)


def _seen(
    office: Office, viewer: Viewer, number: int, trial: int, session: viewing.Session
) -> tuple[Submission, Trial]:
    """Return a trial that somebody may see now, with its submission."""
    submission = session.get(Submission, number) if number < 1 << 31 else None
    if submission is None or trial >= 1 << 31:
        raise UnknownError("no such trial")
    if not viewing.sees_trials(submission.phase, viewer.account, submission, office.clock()):
        raise UnknownError("no such trial")
    found = viewing.trial_of(office, session, submission, trial)
    if found is None:
        raise UnknownError("no such trial")
    return submission, found
