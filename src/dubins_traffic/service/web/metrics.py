"""Numbers for Prometheus: the length of the queue, the states of submissions. For tokens of organisers and workers."""

from __future__ import annotations

from litestar import MediaType, Response, get
from litestar.exceptions import NotAuthorizedException
from prometheus_client import CollectorRegistry, Gauge, generate_latest
from sqlalchemy import func, select

from dubins_traffic.service import viewing
from dubins_traffic.service.tables import Submission
from dubins_traffic.service.web.viewer import OfficeHere, ViewerHere


@get("/metrics", sync_to_thread=True, include_in_schema=False)
def metrics(office: OfficeHere, viewer: ViewerHere) -> Response[bytes]:
    """Return the numbers in Prometheus' text format."""
    if not (viewer.organiser or viewer.worker):
        raise NotAuthorizedException("numbers are for organisers")
    registry = CollectorRegistry()
    with office.database.reading() as session:
        status = viewing.told_status(office, session)
        states = session.execute(select(Submission.state, func.count()).group_by(Submission.state)).all()
    for name in ("waiting", "running", "workers"):
        Gauge(f"dubins_traffic_{name}", f"{name}, see the page of the queue", registry=registry).set(
            status[name]
        )
    gauge = Gauge("dubins_traffic_submissions", "submissions by state", ["state"], registry=registry)
    for state, count in states:
        gauge.labels(state).set(count)
    return Response(generate_latest(registry), media_type=MediaType.TEXT)
