"""Pages of a team about its submissions: send, look on, cancel, name the one that counts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from litestar import Controller, get, post
from litestar.datastructures import UploadFile
from litestar.params import FromPath, MultipartBody
from litestar.response import Redirect, Template

from dubins_traffic.service import receiving, viewing
from dubins_traffic.service.office import Office
from dubins_traffic.service.web import bodies
from dubins_traffic.service.web import viewer as who
from dubins_traffic.service.web.said import page
from dubins_traffic.service.web.viewer import OfficeHere, Viewer, ViewerHere


@dataclass
class Sent:
    """The form with a submission."""

    file: UploadFile


class Submitting(Controller):
    """What a team does with its submissions."""

    include_in_schema = False
    guards = [who.person]  # noqa: RUF012

    @post("/c/{slug:str}/{name:str}/submit", sync_to_thread=True, opt={bodies.FILES: True})
    def submit(
        self,
        office: OfficeHere,
        viewer: ViewerHere,
        slug: FromPath[str],
        name: FromPath[str],
        data: MultipartBody[Sent],
    ) -> Redirect:
        """Take in a submission."""
        sent = data.file.file.read()
        number, _ = receiving.take_in(office, viewer.person, slug, name, data.file.filename, sent)
        return Redirect(f"/s/{number}", status_code=303)

    @get("/s/{number:int}", sync_to_thread=True)
    def submission(self, office: OfficeHere, viewer: ViewerHere, number: FromPath[int]) -> Template:
        """Show a submission."""
        return page(office, viewer, "submission", f"Submission {number}", **_view(office, viewer, number))

    @get("/s/{number:int}/live", sync_to_thread=True)
    def live(self, office: OfficeHere, viewer: ViewerHere, number: FromPath[int]) -> Template:
        """Return the part of the page of a submission that changes."""
        return page(office, viewer, "live", "", **_view(office, viewer, number))

    @post("/s/{number:int}/cancel", sync_to_thread=True)
    def cancel(self, office: OfficeHere, viewer: ViewerHere, number: FromPath[int]) -> Redirect:
        """Cancel a submission."""
        receiving.cancel(office, viewer.person, number)
        return Redirect(f"/s/{number}", status_code=303)

    @post("/s/{number:int}/name", sync_to_thread=True)
    def name(self, office: OfficeHere, viewer: ViewerHere, number: FromPath[int]) -> Redirect:
        """Let a submission be the one that counts."""
        receiving.name_it(office, viewer.person, number)
        return Redirect(f"/s/{number}", status_code=303)


def _view(office: Office, viewer: Viewer, number: int) -> dict[str, Any]:
    with office.database.reading() as session:
        found = receiving.found_submission(session, number, viewer.account)
        places = viewing.places_of(session)
        told = viewing.told_submission(office, session, found, viewer.account, places, logs=False)
        differing = viewing.differing(office, session, found) if "trials" in told else []
        closed = found.phase.is_closed(office.clock())
    return {"submission": told, "differing": differing, "closed": closed}
