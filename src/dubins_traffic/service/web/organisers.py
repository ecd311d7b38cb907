"""The organiser's desk: create, open, close, judge again, disqualify, reveal, export; accounts and the log."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from litestar import Controller, Response, get, post
from litestar.datastructures import UploadFile
from litestar.params import FromPath, FromQuery, MultipartBody, URLEncodedBody
from litestar.response import Redirect, Template
from sqlalchemy import select

from dubins_traffic.controllers import registry
from dubins_traffic.service import accounts, archive, editing, organising, queue, receiving, viewing
from dubins_traffic.service.accounts import WrongEntryError
from dubins_traffic.service.database import numbered
from dubins_traffic.service.database_tables import Account, Act, Competition, Submission, Team
from dubins_traffic.service.receiving import UnknownError
from dubins_traffic.service.service import Service
from dubins_traffic.service.submissions import RefusedError
from dubins_traffic.service.web import requests
from dubins_traffic.service.web.pages import Form, asked, page
from dubins_traffic.service.web.requests import ServiceHere, Viewer, ViewerHere

Given = URLEncodedBody[Form]


@dataclass
class NewCompetition:
    """The form with a new competition: its address and its files."""

    address: str
    files: list[UploadFile]


@dataclass
class Files:
    """The form with files of a competition."""

    files: list[UploadFile]


PHASE_ACTS: dict[str, tuple[Callable[..., None], tuple[str, ...]]] = {
    "open": (organising.open_phase, ()),
    "close": (organising.close_phase, ()),
    "reveal": (organising.reveal, ()),
    "reopen": (organising.reopen_phase, ("until",)),
    "baseline": (organising.add_baseline, ("controller",)),
}
"""What does each act on a phase, and the fields of its form that it is given."""
FOLLOWS = {
    "open": "Teams may hand in from now on, and the commitment to secret seeds is published. A phase that has opened "
    "can be closed, but not made to open later.",
    "close": "What is handed in from now on does not count; what waits is still judged. Everybody sees the table, and "
    "all trials and replays. The phase can be re-opened until its seeds are revealed, but what has been seen is known.",
    "reveal": "Everybody can read the seeds and run the trials again. The phase can't be re-opened after that.",
    "reopen": "Teams may hand in again, and what the phase does not show is hidden again; what has been seen since it "
    "closed is known. Say so in an announcement.",
    "disqualify": "It takes the submission out of the table, and its team reads why. Another submission of the team "
    "counts in its stead, if there is one. It can be let in again.",
    "readmit": "The submission counts again as any other, for no reason to disqualify it is given.",
    "rejudge": "All its trials are run again, and the results so far no longer count; the database keeps them.",
    "retract": "It goes from the page and from the feed; who has read it has read it, and the log keeps its title.",
    "remove": "Name, password and tokens are deleted, and open invitations to the team and by the person end. "
    "Submissions stay with the team. It can't be undone.",
}
"""What follows from acts that are asked for once more."""


class Organisers(Controller):
    """What organisers do."""

    path = "/desk"
    include_in_schema = False
    guards = [requests.organiser]  # noqa: RUF012

    @get("/", sync_to_thread=True, opt={requests.OWN: True})
    def desk(self, service: ServiceHere, viewer: ViewerHere) -> Template:
        """Show the desk."""
        return _shown(service, viewer)

    @post("/create", sync_to_thread=True, opt={requests.FILES: True})
    def create(self, service: ServiceHere, viewer: ViewerHere, data: MultipartBody[NewCompetition]) -> Redirect:
        """Make a competition from its files."""
        made = organising.create(service, data.address, _given(data.files), viewer.person)
        return Redirect(f"/desk/c/{made.slug}", status_code=303)

    @post("/invite", sync_to_thread=True, status_code=200, opt={requests.OWN: True})
    def invite(self, service: ServiceHere, viewer: ViewerHere, data: Given) -> Template:
        """Show a new invitation."""
        role = data.get("role", accounts.PARTICIPANT)
        if role not in accounts.ROLES:
            raise WrongEntryError("role: participant or organiser")
        slug = data.get("competition", "") if viewer.competition is None else viewer.competition.slug
        with service.database.writing() as session:
            of = receiving.competition_named(session, slug) if slug and role == accounts.ORGANISER else None
            code = accounts.invite(session, role, None, service.clock(), by=viewer.person, organises=of)
            what = role if of is None else f"{role} of {slug}"
            accounts.note(session, viewer.person, "invite", what, "", service.clock())
        return _shown(service, viewer, code=code)

    @post("/invitations/{number:int}/revoke", sync_to_thread=True, opt={requests.OWN: True})
    def revoke_invitation(self, service: ServiceHere, viewer: ViewerHere, number: FromPath[int]) -> Redirect:
        """Revoke an invitation, whoever has made it; an organiser of one competition only the own ones."""
        with service.database.writing() as session:
            accounts.revoke_invitation(session, number, service.clock(), made_by=_maker(viewer))
            accounts.note(session, viewer.person, "revoke invitation", f"invitation {number}", "", service.clock())
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

    @get("/accounts/{number:int}/remove", sync_to_thread=True)
    def ask_removal(self, service: ServiceHere, viewer: ViewerHere, number: FromPath[int]) -> Template:
        """Ask whether an account is to be removed."""
        with service.database.reading() as session:
            name = _account(session, number).name
        where = f"/desk/accounts/{number}/remove"
        return asked(service, viewer, where, f"Remove {name}", FOLLOWS["remove"], back="/desk")

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
            news = viewing.news(session, row)
            for phase, shown in zip(row.phases, document["phases"], strict=True):
                its_submissions = receiving.submissions_of(session, phase, None)
                shown["submissions"] = [
                    {"row": one, "team": one.team.name, "place": places.get(one.id)} for one in its_submissions
                ]
        given = {"competition": document, "news": news, "controllers": list(registry.names())}
        return page(service, viewer, "organise", f"Organise {document['title']}", **given)

    @get("/edit/{slug:str}", sync_to_thread=True)
    def edit_page(self, service: ServiceHere, viewer: ViewerHere, slug: FromPath[str]) -> Template:
        """Show the forms that change a competition."""
        with service.database.reading() as session:
            row = receiving.competition_named(session, slug)
            document, was = editing.present(service, row), _digest(row)
            quotas = {phase.name: service.phase(phase).quota for phase in row.phases}
        given = {"document": document, "slug": slug, "was": was, "quotas": quotas, "seconds": editing.seconds}
        return page(service, viewer, "edit", f"Edit {document['title']}", **given)

    @post("/edit/{slug:str}", sync_to_thread=True)
    def edit(self, service: ServiceHere, viewer: ViewerHere, slug: FromPath[str], data: Given) -> Redirect:
        """Change dates, quotas, texts and pages."""
        with service.database.writing() as session:
            row = receiving.competition_named(session, slug)
            if data.get("was") != _digest(row):
                raise RefusedError("somebody has changed it meanwhile: look at it again")
            document = editing.edited_by_form(editing.present(service, row), data)
            editing.edit(service, session, slug, document, viewer.person)
        organising.publish_opened(service)
        return Redirect(f"/desk/c/{slug}", status_code=303)

    @post("/file/{slug:str}", sync_to_thread=True, opt={requests.FILES: True})
    def edit_by_file(
        self, service: ServiceHere, viewer: ViewerHere, slug: FromPath[str], data: MultipartBody[Files]
    ) -> Redirect:
        """Change a competition into what its file says."""
        with service.database.reading() as session:
            receiving.competition_named(session, slug)
        editing.edit_by_files(service, slug, _given(data.files), viewer.person)
        organising.publish_opened(service)
        return Redirect(f"/desk/c/{slug}", status_code=303)

    @post("/news/{slug:str}", sync_to_thread=True)
    def announce(self, service: ServiceHere, viewer: ViewerHere, slug: FromPath[str], data: Given) -> Redirect:
        """Tell everybody something."""
        with service.database.writing() as session:
            row = receiving.competition_named(session, slug)
            organising.announce(service, session, row, viewer.person, data.get("title", ""), data.get("text", ""))
        return Redirect(f"/c/{slug}", status_code=303)

    @get("/retract/{number:int}", sync_to_thread=True, opt={requests.OWN: True})
    def ask_to_retract(self, service: ServiceHere, viewer: ViewerHere, number: FromPath[int]) -> Template:
        """Ask whether an announcement is to be taken back."""
        with service.database.reading() as session:
            row = organising.announced(session, number, viewer.person)
            title, back = f"Retract {row.title}", f"/desk/c/{row.competition.slug}"
        return asked(service, viewer, f"/desk/retract/{number}", title, FOLLOWS["retract"], back=back)

    @post("/retract/{number:int}", sync_to_thread=True, opt={requests.OWN: True})
    def retract(self, service: ServiceHere, viewer: ViewerHere, number: FromPath[int]) -> Redirect:
        """Take an announcement back."""
        with service.database.writing() as session:
            slug = organising.retract(service, session, number, viewer.person)
        return Redirect(f"/desk/c/{slug}", status_code=303)

    @get("/c/{slug:str}/{name:str}/{act:str}", sync_to_thread=True)
    def ask(
        self,
        service: ServiceHere,
        viewer: ViewerHere,
        slug: FromPath[str],
        name: FromPath[str],
        act: FromPath[str],
    ) -> Template:
        """Say what follows from an act, and ask whether it is wanted."""
        if act not in PHASE_ACTS or act not in FOLLOWS:
            raise UnknownError("no such act")
        with service.database.reading() as session:
            receiving.phase_named(session, slug, name)
        where, title = f"/desk/c/{slug}/{name}/{act}", f"{act.capitalize()} {name}"
        until = "until" if "until" in PHASE_ACTS[act][1] else ""
        return asked(service, viewer, where, title, FOLLOWS[act], back=f"/desk/c/{slug}", until=until)

    @post("/c/{slug:str}/{name:str}/{act:str}", sync_to_thread=True)
    def act(
        self,
        service: ServiceHere,
        viewer: ViewerHere,
        slug: FromPath[str],
        name: FromPath[str],
        act: FromPath[str],
        data: Given,
    ) -> Redirect:
        """Open, close, re-open or reveal a phase, or hand in a built-in controller."""
        with service.database.writing() as session:
            phase = receiving.phase_named(session, slug, name)
            if act not in PHASE_ACTS:
                raise UnknownError("no such act")
            carried_out, fields = PHASE_ACTS[act]
            carried_out(service, session, phase, viewer.person, *(data.get(field, "") for field in fields))
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

    @get("/c/{slug:str}/archive.zip", sync_to_thread=True)
    def archive(self, service: ServiceHere, slug: FromPath[str]) -> Response[bytes]:
        """Return a finished competition as a static site."""
        with service.database.reading() as session:
            data = archive.archive(service, session, receiving.competition_named(session, slug))
        headers = {"content-disposition": f'attachment; filename="{slug}-site.zip"'}
        return Response(data, media_type="application/zip", headers=headers)

    @get("/s/{number:int}/{act:str}", sync_to_thread=True, opt={requests.OWN: True})
    def ask_of_submission(
        self,
        service: ServiceHere,
        viewer: ViewerHere,
        number: FromPath[int],
        act: FromPath[str],
        why: FromQuery[str] = "",
    ) -> Template:
        """Say what follows from an act on a submission, and ask whether it is wanted."""
        if act not in ("rejudge", "disqualify"):
            raise UnknownError("no such act")
        with service.database.reading() as session:
            slug = _submission(session, number, viewer).phase.competition.slug
        told = "readmit" if act == "disqualify" and not why.strip() else act
        title = f"{told.capitalize()} submission {number}"
        where, back = f"/desk/s/{number}/{act}", f"/desk/c/{slug}"
        return asked(service, viewer, where, title, FOLLOWS[told], back=back, why=why)

    @post("/s/{number:int}/{act:str}", sync_to_thread=True, opt={requests.OWN: True})
    def submission(
        self, service: ServiceHere, viewer: ViewerHere, number: FromPath[int], act: FromPath[str], data: Given
    ) -> Redirect:
        """Judge a submission again, or disqualify it."""
        acts = {"rejudge": organising.judge_again, "disqualify": organising.disqualify}
        if act not in acts:
            raise UnknownError("no such act")
        with service.database.writing() as session:
            row = _submission(session, number, viewer)
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


def _given(files: list[UploadFile]) -> dict[str, bytes]:
    given = {item.filename: item.file.read() for item in files if item.filename}
    if not given:
        raise WrongEntryError("files: choose competition.toml and the files that it names")
    return given


def _digest(row: Competition) -> str:
    """Return what tells whether a competition is as it was when a form was shown."""
    dates = [(phase.opens, phase.closes) for phase in row.phases]
    return hashlib.sha256(f"{dates} {row.document}".encode()).hexdigest()


def _account(session: viewing.Session, number: int) -> Account:
    account = numbered(session, Account, number)
    if account is None or account.removed is not None:
        raise UnknownError("no such account")
    return account


def _submission(session: viewing.Session, number: int, viewer: Viewer) -> Submission:
    """Return a submission to a competition that somebody organises; UnknownError if there is none."""
    row = numbered(session, Submission, number)
    if row is None or not viewing.organises(viewer.person, row.phase.competition_id):
        raise UnknownError("no such submission")
    return row


def _maker(viewer: Viewer) -> Account | None:
    """Return of whom alone somebody sees the invitations: organisers of one competition of themselves."""
    return None if viewer.competition is None else viewer.person


def _shown(service: Service, viewer: Viewer, **secret: Any) -> Template:
    with service.database.reading() as session:
        rows = session.scalars(select(Competition).order_by(Competition.id.desc())).all()
        competitions = [row for row in rows if viewer.organises(row.slug)]
        people = session.scalars(select(Account).where(Account.removed.is_(None)).order_by(Account.id)).all()
        teams = {team.id: team.name for team in session.scalars(select(Team))}
        workers = accounts.worker_tokens(session)
        invitations = accounts.invitations(session, service.clock(), made_by=_maker(viewer))
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
