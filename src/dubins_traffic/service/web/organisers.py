"""The organiser's desk: create, open, close, judge again, disqualify, reveal, export; accounts and the log."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from litestar import Controller, Response, get, post
from litestar.datastructures import UploadFile
from litestar.params import FromPath, MultipartBody, URLEncodedBody
from litestar.response import Redirect, Template
from sqlalchemy import select

from dubins_traffic.service import accounts, organising, queue, receiving, viewing
from dubins_traffic.service.accounts import WrongEntryError
from dubins_traffic.service.database_tables import Account, Act, Competition, Submission, Team
from dubins_traffic.service.receiving import UnknownError
from dubins_traffic.service.service import Service
from dubins_traffic.service.web import requests
from dubins_traffic.service.web.pages import Form, page
from dubins_traffic.service.web.requests import ServiceHere, Viewer, ViewerHere

Given = URLEncodedBody[Form]


@dataclass
class NewCompetition:
    """The form with a new competition: its address and its files."""

    address: str
    files: list[UploadFile]


class Organisers(Controller):
    """What organisers do."""

    path = "/desk"
    include_in_schema = False
    guards = [requests.organiser]  # noqa: RUF012

    @get("/", sync_to_thread=True)
    def desk(self, service: ServiceHere, viewer: ViewerHere) -> Template:
        """Show the desk."""
        return _shown(service, viewer)

    @post("/create", sync_to_thread=True, opt={requests.FILES: True})
    def create(
        self,
        service: ServiceHere,
        viewer: ViewerHere,
        data: MultipartBody[NewCompetition],
    ) -> Redirect:
        """Make a competition from its files."""
        given = {item.filename: item.file.read() for item in data.files if item.filename}
        if not given:
            raise WrongEntryError("files: choose competition.toml and the files that it names")
        made = organising.create(service, data.address, given, viewer.person)
        return Redirect(f"/desk/c/{made.slug}", status_code=303)

    @post("/invite", sync_to_thread=True, status_code=200)
    def invite(self, service: ServiceHere, viewer: ViewerHere, data: Given) -> Template:
        """Show a new invitation."""
        role = data.get("role", accounts.PARTICIPANT)
        if role not in accounts.ROLES:
            raise WrongEntryError("role: participant or organiser")
        with service.database.writing() as session:
            code = accounts.invite(session, role, None, service.clock(), by=viewer.person)
            accounts.note(session, viewer.person, "invite", role, "", service.clock())
        return _shown(service, viewer, code=code)

    @post("/invitations/{number:int}/revoke", sync_to_thread=True)
    def revoke_invitation(self, service: ServiceHere, viewer: ViewerHere, number: FromPath[int]) -> Redirect:
        """Revoke an invitation, whoever has made it."""
        with service.database.writing() as session:
            accounts.revoke_invitation(session, number, service.clock())
            accounts.note(
                session, viewer.person, "revoke invitation", f"invitation {number}", "", service.clock()
            )
        return Redirect("/desk", status_code=303)

    @post("/worker", sync_to_thread=True, status_code=200)
    def worker(self, service: ServiceHere, viewer: ViewerHere, data: Given) -> Template:
        """Show the token of a new worker, this once."""
        if accounts.clean_name(data.get("name", ""), "name") == accounts.LOCAL:
            raise WrongEntryError("name: that of the workers beside the server")
        with service.database.writing() as session:
            token = accounts.new_token(session, data.get("name", ""), None, service.clock())
            accounts.note(session, viewer.person, "worker token", data.get("name", ""), "", service.clock())
        return _shown(service, viewer, token=token)

    @post("/worker/{number:int}/revoke", sync_to_thread=True)
    def revoke(self, service: ServiceHere, viewer: ViewerHere, number: FromPath[int]) -> Redirect:
        """Revoke the token of a worker; what it has on lease goes to another."""
        with service.database.writing() as session:
            token = next((one for one in accounts.worker_tokens(session) if one.id == number), None)
            if token is None:
                raise WrongEntryError("no such worker")
            token.revoked = service.clock()
            accounts.note(session, viewer.person, "revoke worker", token.name, "", service.clock())
        return Redirect("/desk", status_code=303)

    @post("/accounts/{number:int}/reset", sync_to_thread=True, status_code=200)
    def reset(self, service: ServiceHere, viewer: ViewerHere, number: FromPath[int]) -> Template:
        """Show a code by which a person can choose another password."""
        with service.database.writing() as session:
            account = _account(session, number)
            code = accounts.offer_reset(session, account, service.clock())
            accounts.note(session, viewer.person, "reset", f"account {number}", "", service.clock())
        return _shown(service, viewer, reset=code)

    @post("/accounts/{number:int}/remove", sync_to_thread=True)
    def remove(self, service: ServiceHere, viewer: ViewerHere, number: FromPath[int]) -> Redirect:
        """Remove an account."""
        with service.database.writing() as session:
            accounts.remove(session, _account(session, number), service.clock())
            accounts.note(session, viewer.person, "remove account", f"account {number}", "", service.clock())
        return Redirect("/desk", status_code=303)

    @get("/c/{slug:str}", sync_to_thread=True)
    def competition(self, service: ServiceHere, viewer: ViewerHere, slug: FromPath[str]) -> Template:
        """Show the phases of a competition and all its submissions."""
        with service.database.reading() as session:
            row = receiving.competition_named(session, slug)
            document, places = (
                viewing.competition_document(service, row),
                queue.places(session, service.clock()),
            )
            for phase, shown in zip(row.phases, document["phases"], strict=True):
                its_submissions = receiving.submissions_of(session, phase, None)
                shown["submissions"] = [
                    {"row": one, "team": one.team.name, "place": places.get(one.id)}
                    for one in its_submissions
                ]
        return page(service, viewer, "organise", f"Organise {document['title']}", competition=document)

    @post("/c/{slug:str}/{name:str}/{act:str}", sync_to_thread=True)
    def act(
        self,
        service: ServiceHere,
        viewer: ViewerHere,
        slug: FromPath[str],
        name: FromPath[str],
        act: FromPath[str],
    ) -> Redirect:
        """Open, close or reveal a phase."""
        acts = {"open": organising.open_phase, "close": organising.close_phase, "reveal": organising.reveal}
        if act not in acts:
            raise UnknownError("no such act")
        with service.database.writing() as session:
            acts[act](service, session, receiving.phase_named(session, slug, name), viewer.person)
        organising.publish_opened(service)
        return Redirect(f"/desk/c/{slug}", status_code=303)

    @get("/c/{slug:str}/export.zip", sync_to_thread=True)
    def export(self, service: ServiceHere, slug: FromPath[str]) -> Response[bytes]:
        """Return all that is needed to run the competition again."""
        with service.database.reading() as session:
            row = receiving.competition_named(session, slug)
            data = organising.export(service, session, row)
        headers = {"content-disposition": f'attachment; filename="{slug}.zip"'}
        return Response(data, media_type="application/zip", headers=headers)

    @post("/s/{number:int}/{act:str}", sync_to_thread=True)
    def submission(
        self, service: ServiceHere, viewer: ViewerHere, number: FromPath[int], act: FromPath[str], data: Given
    ) -> Redirect:
        """Judge a submission again, or disqualify it."""
        acts = {"rejudge": organising.judge_again, "disqualify": organising.disqualify}
        if act not in acts:
            raise UnknownError("no such act")
        with service.database.writing() as session:
            row = session.get(Submission, number) if number < 1 << 31 else None
            if row is None:
                raise UnknownError("no such submission")
            acts[act](service, session, row, viewer.person, data.get("why", ""))
            slug = row.phase.competition.slug
        return Redirect(f"/desk/c/{slug}", status_code=303)

    @get("/log", sync_to_thread=True)
    def log(self, service: ServiceHere, viewer: ViewerHere) -> Template:
        """Show what organisers did."""
        with service.database.reading() as session:
            acts = session.scalars(select(Act).order_by(Act.id.desc()).limit(500)).all()
            names = {account.id: account.name for account in session.scalars(select(Account))}
        return page(service, viewer, "log", "Log of acts", acts=acts, names=names)


def _account(session: viewing.Session, number: int) -> Account:
    account = session.get(Account, number) if number < 1 << 31 else None
    if account is None or account.removed is not None:
        raise UnknownError("no such account")
    return account


def _shown(service: Service, viewer: Viewer, **secret: Any) -> Template:
    with service.database.reading() as session:
        competitions = session.scalars(select(Competition).order_by(Competition.id.desc())).all()
        people = session.scalars(select(Account).where(Account.removed.is_(None)).order_by(Account.id)).all()
        teams = {team.id: team.name for team in session.scalars(select(Team))}
        workers = accounts.worker_tokens(session)
        invitations = accounts.invitations(session, service.clock())
        unjudged = [f"{row.competition.slug}/{row.name}" for row in service.waiting_for_key(session)]
    given = {"code": "", "token": "", "reset": "", **secret}
    return page(
        service,
        viewer,
        "desk",
        "Desk",
        competitions=competitions,
        people=people,
        teams=teams,
        workers=workers,
        invitations=invitations,
        unjudged=unjudged,
        key_file=service.key_file,
        url=service.settings.url,
        **given,
    )
