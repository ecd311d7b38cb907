"""Who asks: a person who has logged in, a person's or a worker's token, or anybody."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import anyio.to_thread
from litestar.connection import ASGIConnection
from litestar.di import NamedDependency
from litestar.exceptions import NotAuthorizedException, PermissionDeniedException
from litestar.handlers import BaseRouteHandler
from litestar.middleware import AbstractAuthenticationMiddleware, AuthenticationResult

from dubins_traffic.service import accounts
from dubins_traffic.service.office import Office
from dubins_traffic.service.tables import Account, Team

OfficeHere = NamedDependency[Office]
"""The office, as handlers are given it."""
Asked = ASGIConnection[Any, Any, Any, Any]
BEARER = "bearer "
PROGRAMS = ("/api/", "/worker/", "/metrics")
"""Beginnings of the paths that programs ask for, by token."""


@dataclass(frozen=True)
class Viewer:
    """Who asks. Nobody has an account; a worker has none either."""

    account: Account | None = None
    team: Team | None = None
    worker: bool = False

    @property
    def organiser(self) -> bool:
        """Whether this is an organiser."""
        return self.account is not None and self.account.role == accounts.ORGANISER

    @property
    def person(self) -> Account:
        """The account; NotAuthorizedException if there is none."""
        if self.account is None:
            raise NotAuthorizedException("log in first")
        return self.account


ViewerHere = NamedDependency[Viewer]
"""Who asks, as handlers are given it."""


class Recognition(AbstractAuthenticationMiddleware):
    """Finds out who asks: by the session on pages, by the token alone where programs ask."""

    async def authenticate_request(self, connection: Asked) -> AuthenticationResult:
        """Return the viewer."""
        office: Office = connection.app.state["office"]
        if connection.url.path.startswith(PROGRAMS):
            given = connection.headers.get("authorization", "")
            token = given[len(BEARER) :].strip() if given.lower().startswith(BEARER) else ""
            viewer = await anyio.to_thread.run_sync(_by_token, office, token) if token else Viewer()
            if token and viewer == Viewer():
                raise NotAuthorizedException("the token is unknown or revoked")
        else:
            session = connection.session if "session" in connection.scope else {}
            viewer = await anyio.to_thread.run_sync(_by_session, office, dict(session or {}))
        return AuthenticationResult(user=viewer, auth=None)


def _by_token(office: Office, token: str) -> Viewer:
    with office.database.reading() as session:
        found = accounts.token_of(session, token)
        if found is None:
            return Viewer()
        if found.account_id is None:
            return Viewer(worker=True)
        account = session.get_one(Account, found.account_id)
        return Viewer(account, account.team)


def _by_session(office: Office, data: dict[str, Any]) -> Viewer:
    number = data.get("account")
    if not isinstance(number, int):
        return Viewer()
    with office.database.reading() as session:
        account = session.get(Account, number)
        if account is None or account.removed is not None or account.epoch != data.get("epoch"):
            return Viewer()
        return Viewer(account, account.team)


def person(connection: Asked, _handler: BaseRouteHandler) -> None:
    """Let in who has an account."""
    viewer: Viewer = connection.user
    if viewer.account is None:
        raise NotAuthorizedException("log in first")


def organiser(connection: Asked, handler: BaseRouteHandler) -> None:
    """Let in organisers."""
    person(connection, handler)
    if not connection.user.organiser:
        raise PermissionDeniedException("this is for organisers")


def worker(connection: Asked, _handler: BaseRouteHandler) -> None:
    """Let in workers."""
    if not connection.user.worker:
        raise NotAuthorizedException("this is for workers, by their token")
