"""Logging in and out, joining by an invitation, a new password by a code."""

from __future__ import annotations

import secrets
from typing import Any

from litestar import Controller, Request, get, post
from litestar.params import FromQuery, URLEncodedBody
from litestar.response import Redirect, Template

from dubins_traffic.service import accounts
from dubins_traffic.service.accounts import WrongEntryError
from dubins_traffic.service.tables import Account
from dubins_traffic.service.web.said import Form, page
from dubins_traffic.service.web.viewer import OfficeHere, ViewerHere

Given = URLEncodedBody[Form]
Asked = Request[Any, Any, Any]


class Login(Controller):
    """The door of people."""

    include_in_schema = False

    @get("/login", sync_to_thread=True)
    def login_page(self, office: OfficeHere, viewer: ViewerHere) -> Template:
        """Show the form to log in."""
        return page(office, viewer, "login", "Log in", wrong="", name="")

    @post("/login", sync_to_thread=True, status_code=200)
    def login(
        self, request: Asked, office: OfficeHere, viewer: ViewerHere, data: Given
    ) -> Template | Redirect:
        """Log in."""
        with office.database.reading() as session:
            account = accounts.verified(session, data.get("name", ""), data.get("password", ""))
        if account is None:
            wrong = "No account has this name and password."
            return page(office, viewer, "login", "Log in", wrong=wrong, name=data.get("name", ""))
        return _enter(request, account)

    @post("/logout", sync_to_thread=False)
    def logout(self, request: Asked) -> Redirect:
        """Log out."""
        request.clear_session()
        return Redirect("/")

    @get("/join", sync_to_thread=True)
    def join_page(self, office: OfficeHere, viewer: ViewerHere, code: FromQuery[str] = "") -> Template:
        """Show the form to make an account."""
        return page(office, viewer, "join", "Join", wrong="", given={"code": code})

    @post("/join", sync_to_thread=True, status_code=200)
    def join(
        self, request: Asked, office: OfficeHere, viewer: ViewerHere, data: Given
    ) -> Template | Redirect:
        """Make an account by an invitation, and log in."""
        try:
            with office.database.writing() as session:
                account = accounts.register(
                    session,
                    data.get("code", ""),
                    data.get("name", ""),
                    data.get("password", ""),
                    data.get("team", ""),
                    office.clock(),
                )
        except WrongEntryError as error:
            return page(office, viewer, "join", "Join", wrong=str(error), given={**data, "password": ""})
        return _enter(request, account)

    @get("/reset", sync_to_thread=True)
    def reset_page(self, office: OfficeHere, viewer: ViewerHere, code: FromQuery[str] = "") -> Template:
        """Show the form for a new password."""
        return page(office, viewer, "reset", "New password", wrong="", code=code)

    @post("/reset", sync_to_thread=True, status_code=200)
    def reset(
        self, request: Asked, office: OfficeHere, viewer: ViewerHere, data: Given
    ) -> Template | Redirect:
        """Set a new password by a code, and log in."""
        try:
            with office.database.writing() as session:
                account = accounts.reset(
                    session, data.get("code", ""), data.get("password", ""), office.clock()
                )
        except WrongEntryError as error:
            return page(office, viewer, "reset", "New password", wrong=str(error), code=data.get("code", ""))
        return _enter(request, account)


def keep(request: Asked, account: Account) -> None:
    """Begin a session: whose it is, the number of the password with which it was begun, and what no other has."""
    session: Any = {"account": account.id, "epoch": account.epoch, "begun": secrets.token_hex(16)}
    request.set_session(session)  # pyright: ignore[reportUnknownMemberType]


def _enter(request: Asked, account: Account) -> Redirect:
    """Begin a session, and lead on."""
    keep(request, account)
    return Redirect("/", status_code=303)
