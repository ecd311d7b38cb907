"""The API of participants: what the pages show, as JSON, by a token; and numbers for Prometheus."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from litestar import Controller, MediaType, Response, get, post
from litestar.datastructures import UploadFile
from litestar.exceptions import NotAuthorizedException
from litestar.params import MultipartBody, PathParameter
from prometheus_client import CollectorRegistry, Gauge, generate_latest
from sqlalchemy import func, select

from dubins_traffic.service import queue, receiving, viewing
from dubins_traffic.service.database_tables import Competition, Submission
from dubins_traffic.service.service import Service
from dubins_traffic.service.web import requests
from dubins_traffic.service.web.requests import ServiceHere, Viewer, ViewerHere

Name = Annotated[str, PathParameter(pattern="^[a-z0-9-]{1,60}$")]
Number = Annotated[int, PathParameter(ge=1, le=2**31 - 1)]


@dataclass
class Handed:
    """A submission: a controller in Python, a zip archive or a program."""

    file: UploadFile


class Api(Controller):
    """What programs of participants ask."""

    path = "/api"
    tags = ["participants"]  # noqa: RUF012

    @get("/status", sync_to_thread=True)
    def status(self, service: ServiceHere) -> dict[str, Any]:
        """Return how long the queue is, and how many workers there are."""
        with service.database.reading() as session:
            return viewing.status_document(service, session)

    @get("/competitions", sync_to_thread=True)
    def competitions(self, service: ServiceHere) -> list[dict[str, Any]]:
        """Return all competitions."""
        with service.database.reading() as session:
            rows = session.scalars(select(Competition).order_by(Competition.id)).all()
            return [viewing.competition_document(service, row) for row in rows]

    @get("/competitions/{slug:str}", sync_to_thread=True)
    def competition(self, service: ServiceHere, slug: Name) -> dict[str, Any]:
        """Return a competition and its phases."""
        with service.database.reading() as session:
            return viewing.competition_document(service, receiving.competition_named(session, slug))

    @get("/competitions/{slug:str}/file", sync_to_thread=True)
    def file(self, service: ServiceHere, slug: Name) -> dict[str, Any]:
        """Return the competition file with its configurations written in, so that it can be evaluated at home."""
        with service.database.reading() as session:
            return dict(service.competition(receiving.competition_named(session, slug)).document)

    @get("/competitions/{slug:str}/phases/{name:str}/table", sync_to_thread=True)
    def table(self, service: ServiceHere, viewer: ViewerHere, slug: Name, name: Name) -> list[dict[str, Any]]:
        """Return the table of a phase, as far as it may be seen."""
        with service.database.reading() as session:
            row = receiving.phase_named(session, slug, name)
            return viewing.latest_places(service, session, row, viewer.account)[1]

    @get("/account", sync_to_thread=True, guards=[requests.person])
    def account(self, viewer: ViewerHere) -> dict[str, Any]:
        """Return whose token this is."""
        return {
            "name": viewer.person.name,
            "role": viewer.person.role,
            "team": viewer.team and viewer.team.name,
        }

    @get(
        "/competitions/{slug:str}/phases/{name:str}/submissions",
        sync_to_thread=True,
        guards=[requests.person],
    )
    def submissions(self, service: ServiceHere, viewer: ViewerHere, slug: Name, name: Name) -> list[dict[str, Any]]:
        """Return the submissions of the own team to a phase, newest first."""
        with service.database.reading() as session:
            row = receiving.phase_named(session, slug, name)
            if viewer.person.team_id is None:
                return []
            places = queue.places(session, service.clock())
            its_submissions = receiving.submissions_of(session, row, viewer.person.team_id)
            return [
                viewing.submission_document(service, session, one, viewer.person, places) for one in its_submissions
            ]

    @post(
        "/competitions/{slug:str}/phases/{name:str}/submissions",
        sync_to_thread=True,
        guards=[requests.person],
        opt={requests.FILES: True},
    )
    def submit(
        self, service: ServiceHere, viewer: ViewerHere, slug: Name, name: Name, data: MultipartBody[Handed]
    ) -> Response[dict[str, Any]]:
        """Hand in a submission; the same bytes again are the same submission, with status 200."""
        sent = data.file.file.read()
        number, new = receiving.take_in(service, viewer.person, slug, name, data.file.filename, sent)
        return Response(_view(service, viewer, number), status_code=201 if new else 200)

    @get("/submissions/{number:int}", sync_to_thread=True, guards=[requests.person])
    def submission(self, service: ServiceHere, viewer: ViewerHere, number: Number) -> dict[str, Any]:
        """Return what may be seen of a submission."""
        return _view(service, viewer, number)

    @post("/submissions/{number:int}/cancel", sync_to_thread=True, guards=[requests.person], status_code=200)
    def cancel(self, service: ServiceHere, viewer: ViewerHere, number: Number) -> dict[str, Any]:
        """Cancel a submission."""
        receiving.cancel(service, viewer.person, number)
        return _view(service, viewer, number)

    @post("/submissions/{number:int}/name", sync_to_thread=True, guards=[requests.person], status_code=200)
    def name(self, service: ServiceHere, viewer: ViewerHere, number: Number) -> dict[str, Any]:
        """Let a submission be the one of its team that counts."""
        receiving.name_it(service, viewer.person, number)
        return _view(service, viewer, number)

    @get("/submissions/{number:int}/logs", sync_to_thread=True, guards=[requests.person])
    def logs(self, service: ServiceHere, viewer: ViewerHere, number: Number) -> dict[str, Any]:
        """Return the logs of a submission that may be seen: of all trials, or the tail of one."""
        submission = _view(service, viewer, number)
        if "trials" in submission:
            return {"trials": [{"number": trial["number"], "log": trial["log"]} for trial in submission["trials"]]}
        return {"log": submission.get("log", "")}


def _view(service: Service, viewer: Viewer, number: int) -> dict[str, Any]:
    with service.database.reading() as session:
        submission = receiving.submission_numbered(session, number, viewer.account)
        return viewing.submission_document(
            service, session, submission, viewer.account, queue.places(session, service.clock())
        )


@get("/metrics", sync_to_thread=True, include_in_schema=False)
def metrics(service: ServiceHere, viewer: ViewerHere) -> Response[bytes]:
    """Return the numbers in Prometheus' text format."""
    if not (viewer.organiser or viewer.worker):
        raise NotAuthorizedException("numbers are for organisers")
    registry = CollectorRegistry()
    with service.database.reading() as session:
        status = viewing.status_document(service, session)
        states = session.execute(select(Submission.state, func.count()).group_by(Submission.state)).all()
    for name in ("waiting", "running", "workers"):
        Gauge(f"dubins_traffic_{name}", f"{name}, see the page of the queue", registry=registry).set(status[name])
    gauge = Gauge("dubins_traffic_submissions", "submissions by state", ["state"], registry=registry)
    for state, count in states:
        gauge.labels(state).set(count)
    return Response(generate_latest(registry), media_type=MediaType.TEXT)
