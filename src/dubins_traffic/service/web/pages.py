"""Pages: those that everybody may open, those of a team about itself and its submissions, and those to log in."""

from __future__ import annotations

import secrets
from dataclasses import dataclass
from typing import Annotated, Any
from urllib.parse import quote

from litestar import Controller, MediaType, Request, Response, get, post
from litestar.datastructures import UploadFile
from litestar.exceptions import NotFoundException
from litestar.params import FromPath, FromQuery, MultipartBody, QueryParameter, URLEncodedBody
from litestar.response import Redirect, Template
from sqlalchemy import select
from sqlalchemy.orm import Session

from dubins_traffic.competition import sealing
from dubins_traffic.competition.competition import WALL_S
from dubins_traffic.service import (
    accounts,
    comparing,
    pictures,
    queue,
    receiving,
    submissions,
    texts,
    viewing,
)
from dubins_traffic.service.accounts import WrongEntryError
from dubins_traffic.service.database import LARGEST_NUMBER, numbered
from dubins_traffic.service.database_tables import Account, Competition, Submission, Team, Token, Trial
from dubins_traffic.service.hiding import replays_of
from dubins_traffic.service.receiving import UnknownError
from dubins_traffic.service.service import Service
from dubins_traffic.service.submissions import RefusedError
from dubins_traffic.service.web import requests
from dubins_traffic.service.web.requests import ServiceHere, Viewer, ViewerHere
from dubins_traffic.viewer.pages import part

Form = dict[str, str]
TEMPLATES = "service/web/templates"


def page(service: Service, viewer: Viewer, template: str, title: str, /, **given: Any) -> Template:
    """Return a page by its template."""
    context = {
        "viewer": viewer,
        "site": service.settings.name,
        "title": title,
        "now": service.clock(),
        **given,
    }
    return Template(f"{TEMPLATES}/{template}.html", context=context)


def asked(
    service: Service,
    viewer: Viewer,
    where: str,
    title: str,
    follows: str,
    *,
    back: str,
    why: str = "",
    until: str = "",
) -> Template:
    """Return the page that asks once before an act: what follows from it, and a form that does it."""
    given = {"where": where, "follows": follows, "back": back, "why": why, "until": until}
    return page(service, viewer, "confirm", title, **given)


MINUTE, HOUR = 60, 3600
REPLAY_POLICY = (
    "sandbox allow-scripts; default-src 'none'; img-src data:; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
)
"""Beside the policy that the page of a replay has of itself, which names its one script by its hash."""


class Pages(Controller):
    """What everybody may read."""

    include_in_schema = False

    @get("/", sync_to_thread=True)
    def home(self, service: ServiceHere, viewer: ViewerHere) -> Template:
        """Show all competitions."""
        with service.database.reading() as session:
            rows = session.scalars(select(Competition).order_by(Competition.id.desc())).all()
            documents = [viewing.competition_document(service, row) for row in rows]
            for row, document in zip(rows, documents, strict=True):
                for phase, shown in zip(row.phases, document["phases"], strict=True):
                    shown["left"] = phase.left(service.clock())
        return page(service, viewer, "home", "Competitions", competitions=documents)

    @get("/c/{slug:str}", sync_to_thread=True)
    def competition(self, service: ServiceHere, viewer: ViewerHere, slug: FromPath[str]) -> Template:
        """Show a competition and its phases."""
        with service.database.reading() as session:
            row = receiving.competition_named(session, slug)
            document, news = viewing.competition_document(service, row), viewing.news(session, row)
            for phase, shown in zip(row.phases, document["phases"], strict=True):
                shown["left"] = phase.left(service.clock())
                _, shown["places"] = viewing.latest_places(service, session, phase, viewer.account)
                shown["replays"] = comparing.replays(service, session, phase, shown["places"], viewer.account)
            line = comparing.timeline(row.phases, service.clock())
        given = {"competition": document, "news": news, "line": line}
        return page(service, viewer, "competition", document["title"], **given)

    @get("/trial.svg", sync_to_thread=True)
    def moving_trial(self) -> Response[str]:
        """Return a trial that moves; `scripts.moving_trial` makes it."""
        return _picture(part("service/web/static/trial.svg"), HOUR)

    @get("/c/{slug:str}/{name:str}", sync_to_thread=True)
    def phase(self, service: ServiceHere, viewer: ViewerHere, slug: FromPath[str], name: FromPath[str]) -> Template:
        """Show a phase: rules, limits, the form to submit, the own submissions."""
        at, account = service.clock(), viewer.account
        with service.database.reading() as session:
            row = receiving.phase_named(session, slug, name)
            document, mine, used = viewing.phase_document(service, row, at), [], None
            if account is not None and account.team_id is not None:
                places = queue.places(session, service.clock())
                its_submissions = receiving.submissions_of(session, row, account.team_id)
                mine = [
                    viewing.submission_document(service, session, one, None, places, logs=False)
                    for one in its_submissions
                ]
                for one in mine:
                    one["wait"] = comparing.wait_of(session, one["place"], at)
                used = submissions.used(session, row, account.team_id, at)
            title, steps = (
                row.competition.title,
                comparing.steps(service, row, mine[::-1][-comparing.SHOWN :]),
            )
        given = {
            "steps": steps,
            "phase": document,
            "own": mine,
            "used": used,
            "slug": slug,
            "competition": title,
        }
        largest = service.settings.largest_upload
        return page(service, viewer, "phase", f"{title}: {name}", largest=largest, wall_bounds=WALL_S, **given)

    @get("/c/{slug:str}/{name:str}/table", sync_to_thread=True)
    def table(
        self,
        service: ServiceHere,
        viewer: ViewerHere,
        slug: FromPath[str],
        name: FromPath[str],
        page_number: Annotated[int, QueryParameter(name="page", ge=0, le=1_000_000)] = 0,
    ) -> Template:
        """Show the leaderboard of a phase, and a page of its history."""
        account, at = viewer.account, service.clock()
        with service.database.reading() as session:
            row = receiving.phase_named(session, slug, name)
            document, sees = viewing.phase_document(service, row, at), viewing.sees_table(row, account, at)
            made, rows = viewing.latest_places(service, session, row, account)
            past, older = viewing.past_places(service, session, row, account, page_number)
            title = row.competition.title
        given = {"phase": document, "slug": slug, "competition": title, "sees": sees, "number": page_number}
        given |= {"made": made, "rows": rows, "past": past, "older": older}
        return page(service, viewer, "table", f"{title}: {name}: table", **given)

    @get("/c/{slug:str}/{name:str}/table.csv", sync_to_thread=True)
    def csv_table(
        self, service: ServiceHere, viewer: ViewerHere, slug: FromPath[str], name: FromPath[str]
    ) -> Response[str]:
        """Return the table of a phase, as far as it may be seen, for spreadsheets."""
        with service.database.reading() as session:
            row = receiving.phase_named(session, slug, name)
            _, rows = viewing.latest_places(service, session, row, viewer.account)
        return Response(texts.csv_of(rows), media_type="text/csv; charset=utf-8")

    @get("/c/{slug:str}/news.atom", sync_to_thread=True)
    def feed(self, request: Request[Any, Any, Any], service: ServiceHere, slug: FromPath[str]) -> Response[bytes]:
        """Return the announcements of a competition as an Atom feed."""
        with service.database.reading() as session:
            row = receiving.competition_named(session, slug)
            news = viewing.news(session, row)
        url = f"{(service.settings.url or str(request.base_url)).rstrip('/')}/c/{slug}"
        return Response(texts.feed(url, row.title, row.created, news), media_type="application/atom+xml")

    @get("/pages/{slug:str}/{name:str}", sync_to_thread=True)
    def text(self, service: ServiceHere, viewer: ViewerHere, slug: FromPath[str], name: FromPath[str]) -> Template:
        """Show a further text of a competition."""
        with service.database.reading() as session:
            row = receiving.competition_named(session, slug)
            text = service.competition(row).model.pages.get(name)
        if text is None:
            raise NotFoundException("no such page")
        return page(service, viewer, "text", f"{row.title}: {name}", slug=slug, competition=row.title, text=text)

    @get("/c/{slug:str}/{name:str}/commitment.json", sync_to_thread=True)
    def commitment(self, service: ServiceHere, slug: FromPath[str], name: FromPath[str]) -> Response[str]:
        """Return the published commitment to secret seeds."""
        with service.database.reading() as session:
            row = receiving.phase_named(session, slug, name)
            if row.commitment is None:
                raise NotFoundException("no commitment has been published")
            path = sealing.commitment_path(service.phase(row))
        return Response(path.read_text(encoding="utf-8"), media_type=MediaType.JSON)

    @get("/c/{slug:str}/{name:str}/seeds.txt", sync_to_thread=True)
    def seeds(self, service: ServiceHere, slug: FromPath[str], name: FromPath[str]) -> Response[str]:
        """Return the revealed seeds."""
        with service.database.reading() as session:
            row = receiving.phase_named(session, slug, name)
            if row.revealed is None:
                raise NotFoundException("the seeds are not revealed")
            path = sealing.revealed_path(service.phase(row))
        return Response(path.read_text(encoding="utf-8"), media_type=MediaType.TEXT)

    @get("/s/{number:int}/trials/{trial:int}", sync_to_thread=True)
    def trial(self, service: ServiceHere, viewer: ViewerHere, number: FromPath[int], trial: FromPath[int]) -> Template:
        """Show a trial: its score, its log, its replay."""
        with service.database.reading() as session:
            submission, row_of_trial = _seen(service, viewer, number, trial, session)
            is_owner = viewing.owns(viewer.account, submission)
            row = row_of_trial.row if is_owner else viewing.shared(row_of_trial.row)
            given = {
                "submission": submission,
                "team": submission.team.name,
                "trial": row_of_trial,
                "row": row,
                "phase": submission.phase.name,
                "slug": submission.phase.competition.slug,
                "own": is_owner,
                "of": len(service.phase(submission.phase).numbers),
            }
        return page(service, viewer, "trial", f"Trial {trial} of submission {number}", **given)

    @get("/s/{number:int}/trials/{trial:int}/replay", sync_to_thread=True)
    def replay(
        self, service: ServiceHere, viewer: ViewerHere, number: FromPath[int], trial: FromPath[int]
    ) -> Response[bytes]:
        """Return the page that replays a trial, for a frame that may do nothing but draw."""
        headers = {"content-encoding": "gzip", "content-security-policy": REPLAY_POLICY}
        data = _replay(service, viewer, number, trial)
        return Response(data, media_type="text/html; charset=utf-8", headers=headers)

    @get("/s/{number:int}/trials/{trial:int}/map.svg", sync_to_thread=True)
    def small_map(
        self, service: ServiceHere, viewer: ViewerHere, number: FromPath[int], trial: FromPath[int]
    ) -> Response[str]:
        """Return a small map of a trial with the ways of its cars."""
        return _picture(pictures.map_of(_replay(service, viewer, number, trial)), MINUTE)

    @get("/status", sync_to_thread=True)
    def status(self, service: ServiceHere, viewer: ViewerHere) -> Template:
        """Show the queue and the workers."""
        with service.database.reading() as session:
            document = viewing.status_document(service, session)
            workers = viewing.workers(session) if viewer.organiser else []
        return page(service, viewer, "status", "Queue and workers", status=document, workers=workers)


def _replay(service: Service, viewer: Viewer, number: int, trial: int) -> bytes:
    """Return the page that replays a trial that somebody may see now, packed by gzip."""
    with service.database.reading() as session:
        submission, row_of_trial = _seen(service, viewer, number, trial, session)
        hiding = service.hiding(submission.phase)
        digest = viewing.replay_of(row_of_trial, submission, viewer.account)
    if digest is None:
        raise NotFoundException("this trial has no replay")
    return hiding.show(service.storage.get(digest, "replays"), replays_of(row_of_trial))


def _picture(drawn: str, seconds: int) -> Response[str]:
    """Return a picture, which the browser of who asks may keep for so long."""
    headers = {"content-security-policy": pictures.POLICY, "cache-control": f"private, max-age={seconds}"}
    return Response(drawn, media_type="image/svg+xml", headers=headers)


def _seen(
    service: Service, viewer: Viewer, number: int, trial: int, session: viewing.Session
) -> tuple[Submission, Trial]:
    """Return a trial that somebody may see now, with its submission."""
    submission = numbered(session, Submission, number)
    if submission is None or trial > LARGEST_NUMBER:
        raise UnknownError("no such trial")
    if not viewing.sees_trials(submission.phase, viewer.account, submission, service.clock()):
        raise UnknownError("no such trial")
    row_of_trial = viewing.trial_of(service, session, submission, trial)
    if row_of_trial is None:
        raise UnknownError("no such trial")
    return submission, row_of_trial


@dataclass
class Sent:
    """The form with a submission."""

    file: UploadFile


class Submitting(Controller):
    """What a team does with its submissions."""

    include_in_schema = False
    guards = [requests.person]  # noqa: RUF012

    @post("/c/{slug:str}/{name:str}/submit", sync_to_thread=True, opt={requests.FILES: True})
    def submit(
        self,
        service: ServiceHere,
        viewer: ViewerHere,
        slug: FromPath[str],
        name: FromPath[str],
        data: MultipartBody[Sent],
    ) -> Redirect:
        """Take in a submission."""
        sent = data.file.file.read()
        number, _ = receiving.take_in(service, viewer.person, slug, name, data.file.filename, sent)
        return Redirect(f"/s/{number}", status_code=303)

    @get("/s/{number:int}", sync_to_thread=True)
    def submission(self, service: ServiceHere, viewer: ViewerHere, number: FromPath[int]) -> Template:
        """Show a submission."""
        return page(service, viewer, "submission", f"Submission {number}", **_view(service, viewer, number))

    @get("/s/{number:int}/live", sync_to_thread=True)
    def live(self, service: ServiceHere, viewer: ViewerHere, number: FromPath[int]) -> Template:
        """Return the part of the page of a submission that changes."""
        return page(service, viewer, "live", "", **_view(service, viewer, number))

    @get("/s/{number:int}/file", sync_to_thread=True)
    def file(self, service: ServiceHere, viewer: ViewerHere, number: FromPath[int]) -> Response[bytes]:
        """Return what a team has sent."""
        with service.database.reading() as session:
            submission = receiving.submission_numbered(session, number, viewer.account)
        name = quote(submission.filename, safe="")
        headers = {"content-disposition": f"attachment; filename*=UTF-8''{name}"}
        data = service.storage.get(submission.digest, "submissions")
        return Response(data, media_type="application/octet-stream", headers=headers)

    @get("/s/{number:int}/beside", sync_to_thread=True)
    def beside(
        self, service: ServiceHere, viewer: ViewerHere, number: FromPath[int], other: FromQuery[int]
    ) -> Template:
        """Show a submission beside another, trial by trial."""
        with service.database.reading() as session:
            shown = comparing.beside(service, session, number, other, viewer.account)
        return page(service, viewer, "beside", f"Submissions {number} and {other}", **shown)

    @post("/s/{number:int}/cancel", sync_to_thread=True)
    def cancel(self, service: ServiceHere, viewer: ViewerHere, number: FromPath[int]) -> Redirect:
        """Cancel a submission."""
        receiving.cancel(service, viewer.person, number)
        return Redirect(f"/s/{number}", status_code=303)

    @post("/s/{number:int}/name", sync_to_thread=True)
    def name(self, service: ServiceHere, viewer: ViewerHere, number: FromPath[int]) -> Redirect:
        """Let a submission be the one that counts."""
        receiving.name_it(service, viewer.person, number)
        return Redirect(f"/s/{number}", status_code=303)


def _view(service: Service, viewer: Viewer, number: int) -> dict[str, Any]:
    with service.database.reading() as session:
        submission = receiving.submission_numbered(session, number, viewer.account)
        places = queue.places(session, service.clock())
        document = viewing.submission_document(service, session, submission, viewer.account, places, logs=False)
        differing = viewing.differing(service, session, submission) if "trials" in document else []
        given: dict[str, Any] = {
            "differing": differing,
            "closed": submission.phase.is_closed(service.clock()),
        }
        if "trials" in document:
            given["strip"] = comparing.strip(service, session, submission)
            given["rivals"] = comparing.rivals(service, session, submission, viewer.account)
        wait = comparing.wait_of(session, document["place"], service.clock())
    return {
        "submission": document,
        "wait": wait,
        "metric": service.phase(submission.phase).ranking.metric,
        **given,
    }


Given = URLEncodedBody[Form]


class Teams(Controller):
    """What a person does with the own team and account."""

    path = "/team"
    include_in_schema = False
    guards = [requests.person]  # noqa: RUF012

    @get("/", sync_to_thread=True)
    def team(self, service: ServiceHere, viewer: ViewerHere) -> Template:
        """Show the team, and the own account."""
        return _shown(service, viewer)

    @post("/found", sync_to_thread=True)
    def found(self, service: ServiceHere, viewer: ViewerHere, data: Given) -> Redirect:
        """Found a team."""
        with service.database.writing() as session:
            account = session.get_one(Account, viewer.person.id)
            if account.team_id is not None:
                raise RefusedError("you are in a team already")
            account.team_id = accounts.make_team(session, data.get("name", ""), service.clock()).id
        return Redirect("/team", status_code=303)

    @get("/members/{number:int}/remove", sync_to_thread=True)
    def ask_leaving(self, service: ServiceHere, viewer: ViewerHere, number: FromPath[int]) -> Template:
        """Ask whether somebody is to leave the team."""
        with service.database.reading() as session:
            member = _member(session, viewer, number)
        title = "Leave the team" if number == viewer.person.id else f"Remove {member.name}"
        follows = (
            "The submissions stay with the team, and the account stays as it is. Open invitations to the team end; "
            "only a new one leads back into it."
        )
        return asked(service, viewer, f"/team/members/{number}/remove", title, follows, back="/team")

    @post("/members/{number:int}/remove", sync_to_thread=True)
    def leave(self, service: ServiceHere, viewer: ViewerHere, number: FromPath[int]) -> Redirect:
        """Take a member, such as oneself, out of the team."""
        with service.database.writing() as session:
            member = _member(session, viewer, number)
            subject = f"account {number}, team {member.team_id}"
            accounts.note(session, viewer.person, "leave team", subject, "", service.clock())
            accounts.leave(session, member, service.clock())
        return Redirect("/team", status_code=303)

    @post("/invite", sync_to_thread=True, status_code=200)
    def invite(self, service: ServiceHere, viewer: ViewerHere) -> Template:
        """Show a new code by which one person can join the team."""
        if viewer.team is None:
            raise RefusedError("you are in no team")
        with service.database.writing() as session:
            team = session.get_one(Team, viewer.team.id)
            code = accounts.invite(session, accounts.PARTICIPANT, team, service.clock(), by=viewer.person)
        return _shown(service, viewer, code=code)

    @post("/invitations/{number:int}/revoke", sync_to_thread=True)
    def revoke_invitation(self, service: ServiceHere, viewer: ViewerHere, number: FromPath[int]) -> Redirect:
        """Revoke an invitation to the own team."""
        if viewer.team is None:
            raise RefusedError("you are in no team")
        with service.database.writing() as session:
            accounts.revoke_invitation(session, number, service.clock(), viewer.team.id)
        return Redirect("/team", status_code=303)

    @post("/tokens", sync_to_thread=True, status_code=200)
    def token(self, service: ServiceHere, viewer: ViewerHere, data: Given) -> Template:
        """Show a new token of the API, this once."""
        with service.database.writing() as session:
            account = session.get_one(Account, viewer.person.id)
            token = accounts.new_token(session, data.get("name", ""), account, service.clock())
        return _shown(service, viewer, token=token)

    @post("/tokens/{number:int}/revoke", sync_to_thread=True)
    def revoke(self, service: ServiceHere, viewer: ViewerHere, number: FromPath[int]) -> Redirect:
        """Revoke a token."""
        with service.database.writing() as session:
            token = numbered(session, Token, number)
            if token is None or token.account_id != viewer.person.id:
                raise WrongEntryError("no such token")
            token.revoked = service.clock()
        return Redirect("/team", status_code=303)

    @post("/password", sync_to_thread=True)
    def password(
        self, request: Request[Any, Any, Any], service: ServiceHere, viewer: ViewerHere, data: Given
    ) -> Redirect:
        """Set another password."""
        sure = _sure(service, viewer, data)
        kept = accounts.hashed(data.get("new", ""))
        with service.database.writing() as session:
            account = _still(session, sure)
            accounts.set_password(session, account, kept, service.clock())
            keep(request, account)
        return Redirect("/team", status_code=303)

    @post("/remove", sync_to_thread=True)
    def remove(
        self, request: Request[Any, Any, Any], service: ServiceHere, viewer: ViewerHere, data: Given
    ) -> Redirect:
        """Remove the own account."""
        sure = _sure(service, viewer, data)
        with service.database.writing() as session:
            account = _still(session, sure)
            accounts.remove(session, account, service.clock())
            accounts.note(session, None, "remove account", f"account {account.id}", "by its owner", service.clock())
        request.clear_session()
        return Redirect("/", status_code=303)


def _member(session: Session, viewer: Viewer, number: int) -> Account:
    member = numbered(session, Account, number)
    if member is None or viewer.team is None or member.team_id != viewer.team.id:
        raise UnknownError("no such member of your team")
    return member


def _sure(service: Service, viewer: Viewer, data: Form) -> Account:
    """Return the own account, if the password given is its."""
    with service.database.reading() as session:
        account = accounts.verified(session, viewer.person.name, data.get("password", ""))
    if account is None:
        raise WrongEntryError("password: not that of this account")
    return account


def _still(session: Session, sure: Account) -> Account:
    """Return in a writer's session an account whose password was given, if this is still its password."""
    account = session.get_one(Account, sure.id)
    if account.epoch != sure.epoch:
        raise WrongEntryError("password: not that of this account any more")
    return account


def _shown(service: Service, viewer: Viewer, code: str = "", token: str = "") -> Template:
    with service.database.reading() as session:
        team = session.get(Team, viewer.person.team_id) if viewer.person.team_id else None
        members = [(member.id, member.name) for member in team.accounts] if team else []
        phases = comparing.team_places(service, session, viewer.person, team.id) if team else []
        tokens = accounts.tokens(session, viewer.person)
        invitations = () if team is None else accounts.invitations(session, service.clock(), team.id)
    given = {"team": team, "members": members, "tokens": tokens, "invitations": invitations, "phases": phases}
    return page(service, viewer, "team", "Team and account", url=service.settings.url, code=code, token=token, **given)


Asked = Request[Any, Any, Any]


class Login(Controller):
    """The door of people."""

    include_in_schema = False

    @get("/login", sync_to_thread=True)
    def login_page(self, service: ServiceHere, viewer: ViewerHere) -> Template:
        """Show the form to log in."""
        return page(service, viewer, "login", "Log in", wrong="", name="")

    @post("/login", sync_to_thread=True, status_code=200)
    def login(self, request: Asked, service: ServiceHere, viewer: ViewerHere, data: Given) -> Template | Redirect:
        """Log in."""
        with service.database.reading() as session:
            account = accounts.verified(session, data.get("name", ""), data.get("password", ""))
        if account is None:
            wrong = "No account has this name and password."
            return page(service, viewer, "login", "Log in", wrong=wrong, name=data.get("name", ""))
        return _enter(request, account)

    @post("/logout", sync_to_thread=False)
    def logout(self, request: Asked) -> Redirect:
        """Log out."""
        request.clear_session()
        return Redirect("/")

    @get("/join", sync_to_thread=True)
    def join_page(self, service: ServiceHere, viewer: ViewerHere, code: FromQuery[str] = "") -> Template:
        """Show the form to make an account."""
        return page(service, viewer, "join", "Join", wrong="", given={"code": code})

    @post("/join", sync_to_thread=True, status_code=200)
    def join(self, request: Asked, service: ServiceHere, viewer: ViewerHere, data: Given) -> Template | Redirect:
        """Make an account by an invitation, and log in."""
        try:
            account = accounts.join(
                service.database,
                data.get("code", ""),
                data.get("name", ""),
                data.get("password", ""),
                data.get("team", ""),
                service.clock(),
            )
        except WrongEntryError as error:
            return page(service, viewer, "join", "Join", wrong=str(error), given={**data, "password": ""})
        return _enter(request, account)

    @get("/reset", sync_to_thread=True)
    def reset_page(self, service: ServiceHere, viewer: ViewerHere, code: FromQuery[str] = "") -> Template:
        """Show the form for a new password."""
        return page(service, viewer, "reset", "New password", wrong="", code=code)

    @post("/reset", sync_to_thread=True, status_code=200)
    def reset(self, request: Asked, service: ServiceHere, viewer: ViewerHere, data: Given) -> Template | Redirect:
        """Set a new password by a code, and log in."""
        try:
            account = accounts.reset(service.database, data.get("code", ""), data.get("password", ""), service.clock())
        except WrongEntryError as error:
            return page(service, viewer, "reset", "New password", wrong=str(error), code=data.get("code", ""))
        return _enter(request, account)


def keep(request: Asked, account: Account) -> None:
    """Begin a session: whose it is, the number of the password with which it was begun, and what no other has."""
    session: Any = {"account": account.id, "epoch": account.epoch, "begun": secrets.token_hex(16)}
    request.set_session(session)  # pyright: ignore[reportUnknownMemberType]


def _enter(request: Asked, account: Account) -> Redirect:
    """Begin a session, and lead on."""
    keep(request, account)
    return Redirect("/", status_code=303)
