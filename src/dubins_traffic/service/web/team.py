"""The page of a team and of one's own account: members, invitations, tokens, password, removal."""

from __future__ import annotations

from typing import Any

from litestar import Controller, Request, get, post
from litestar.params import FromPath, URLEncodedBody
from litestar.response import Redirect, Template
from sqlalchemy.orm import Session

from dubins_traffic.service import accounts
from dubins_traffic.service.accounts import WrongEntryError
from dubins_traffic.service.office import Office
from dubins_traffic.service.submissions import RefusedError
from dubins_traffic.service.tables import Account, Team, Token
from dubins_traffic.service.web import login
from dubins_traffic.service.web import viewer as who
from dubins_traffic.service.web.said import Form, page
from dubins_traffic.service.web.viewer import OfficeHere, Viewer, ViewerHere

Given = URLEncodedBody[Form]


class Teams(Controller):
    """What a person does with the own team and account."""

    path = "/team"
    include_in_schema = False
    guards = [who.person]  # noqa: RUF012

    @get("/", sync_to_thread=True)
    def team(self, office: OfficeHere, viewer: ViewerHere) -> Template:
        """Show the team, and the own account."""
        return _shown(office, viewer)

    @post("/found", sync_to_thread=True)
    def found(self, office: OfficeHere, viewer: ViewerHere, data: Given) -> Redirect:
        """Found a team."""
        with office.database.writing() as session:
            account = session.get_one(Account, viewer.person.id)
            if account.team_id is not None:
                raise RefusedError("you are in a team already")
            account.team_id = accounts.found_team(session, data.get("name", ""), office.clock()).id
        return Redirect("/team", status_code=303)

    @post("/invite", sync_to_thread=True, status_code=200)
    def invite(self, office: OfficeHere, viewer: ViewerHere) -> Template:
        """Show a new code by which one person can join the team."""
        if viewer.team is None:
            raise RefusedError("you are in no team")
        with office.database.writing() as session:
            team = session.get_one(Team, viewer.team.id)
            code = accounts.invite(session, accounts.PARTICIPANT, team, office.clock())
        return _shown(office, viewer, code=code)

    @post("/tokens", sync_to_thread=True, status_code=200)
    def token(self, office: OfficeHere, viewer: ViewerHere, data: Given) -> Template:
        """Show a new token of the API, this once."""
        with office.database.writing() as session:
            account = session.get_one(Account, viewer.person.id)
            token = accounts.new_token(session, data.get("name", ""), account, office.clock())
        return _shown(office, viewer, token=token)

    @post("/tokens/{number:int}/revoke", sync_to_thread=True)
    def revoke(self, office: OfficeHere, viewer: ViewerHere, number: FromPath[int]) -> Redirect:
        """Revoke a token."""
        with office.database.writing() as session:
            token = session.get(Token, number) if number < 1 << 31 else None
            if token is None or token.account_id != viewer.person.id:
                raise WrongEntryError("no such token")
            token.revoked = office.clock()
        return Redirect("/team", status_code=303)

    @post("/password", sync_to_thread=True)
    def password(
        self, request: Request[Any, Any, Any], office: OfficeHere, viewer: ViewerHere, data: Given
    ) -> Redirect:
        """Set another password."""
        with office.database.writing() as session:
            account = _sure(session, viewer, data)
            accounts.set_password(session, account, data.get("new", ""), office.clock())
            login.keep(request, account)
        return Redirect("/team", status_code=303)

    @post("/remove", sync_to_thread=True)
    def remove(
        self, request: Request[Any, Any, Any], office: OfficeHere, viewer: ViewerHere, data: Given
    ) -> Redirect:
        """Remove the own account."""
        with office.database.writing() as session:
            account = _sure(session, viewer, data)
            accounts.remove(session, account, office.clock())
            accounts.note(
                session, None, "remove account", f"account {account.id}", "by its owner", office.clock()
            )
        request.clear_session()
        return Redirect("/", status_code=303)


def _sure(session: Session, viewer: Viewer, data: Form) -> Account:
    """Return the own account, if the password given is its."""
    account = accounts.verified(session, viewer.person.name, data.get("password", ""))
    if account is None:
        raise WrongEntryError("password: not that of this account")
    return account


def _shown(office: Office, viewer: Viewer, code: str = "", token: str = "") -> Template:
    with office.database.reading() as session:
        team = session.get(Team, viewer.person.team_id) if viewer.person.team_id else None
        members = [own.name for own in team.accounts] if team else []
        tokens = accounts.tokens(session, viewer.person)
    given = {"team": team, "members": members, "tokens": tokens, "code": code, "token": token}
    return page(office, viewer, "team", "Team and account", url=office.settings.url, **given)
