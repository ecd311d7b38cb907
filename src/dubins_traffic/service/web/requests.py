"""Requests: who asks (who has logged in, the token of a person or a worker, or anybody), and how large they may be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import anyio.to_thread
from litestar.connection import ASGIConnection
from litestar.di import NamedDependency
from litestar.exceptions import ClientException, NotAuthorizedException, PermissionDeniedException
from litestar.exceptions.http_exceptions import RequestEntityTooLarge
from litestar.handlers import BaseRouteHandler
from litestar.middleware import AbstractAuthenticationMiddleware, AuthenticationResult
from litestar.types import ASGIApp, HTTPReceiveMessage, Receive, Scope, Send
from litestar.types.asgi_types import WebSocketReceiveMessage

from dubins_traffic.service import accounts
from dubins_traffic.service.database_tables import Account, Competition, Team
from dubins_traffic.service.service import Service

ServiceHere = NamedDependency[Service]
"""The service, as handlers are given it."""
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
        """Whether this is an organiser, of one competition or of all."""
        return self.account is not None and self.account.role == accounts.ORGANISER

    @property
    def competition(self) -> Competition | None:
        """The one competition that an organiser organises, None for all."""
        return None if self.account is None else self.account.competition

    def organises(self, slug: str) -> bool:
        """Whether this is an organiser of a competition."""
        return self.organiser and (self.competition is None or self.competition.slug == slug)

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
        service: Service = connection.app.state["service"]
        if connection.url.path.startswith(PROGRAMS):
            given = connection.headers.get("authorization", "")
            token = given[len(BEARER) :].strip() if given.lower().startswith(BEARER) else ""
            viewer = await anyio.to_thread.run_sync(_by_token, service, token) if token else Viewer()
            if token and viewer == Viewer():
                raise NotAuthorizedException("the token is unknown or revoked")
        else:
            session = connection.session if "session" in connection.scope else {}
            viewer = await anyio.to_thread.run_sync(_by_session, service, dict(session or {}))
        return AuthenticationResult(user=viewer, auth=None)


def _by_token(service: Service, token: str) -> Viewer:
    with service.database.reading() as session:
        known_token = accounts.token_of(session, token)
        if known_token is None:
            return Viewer()
        if known_token.account_id is None:
            return Viewer(worker=True)
        account = session.get_one(Account, known_token.account_id)
        return Viewer(account, account.team)


def _by_session(service: Service, data: dict[str, Any]) -> Viewer:
    number = data.get("account")
    if not isinstance(number, int):
        return Viewer()
    with service.database.reading() as session:
        account = session.get(Account, number)
        if account is None or account.removed is not None or account.epoch != data.get("epoch"):
            return Viewer()
        return Viewer(account, account.team)


def person(connection: Asked, _handler: BaseRouteHandler) -> None:
    """Let in who has an account."""
    viewer: Viewer = connection.user
    if viewer.account is None:
        raise NotAuthorizedException("log in first")


OWN = "checks_what_is_organised"
"""Option of the routes at the desk that name no competition, and of which organisers of one see what is of that."""


def organiser(connection: Asked, handler: BaseRouteHandler) -> None:
    """Let in organisers; those of one competition where it is named, and where the route says that it minds that."""
    person(connection, handler)
    viewer: Viewer = connection.user
    slug = connection.path_params.get("slug")
    if not viewer.organiser or (slug is not None and not viewer.organises(slug)):
        raise PermissionDeniedException("this is for organisers")
    if slug is None and viewer.competition is not None and not handler.opt.get(OWN):
        raise PermissionDeniedException("this is for organisers of all competitions")


def worker(connection: Asked, _handler: BaseRouteHandler) -> None:
    """Let in workers."""
    if not connection.user.worker:
        raise NotAuthorizedException("this is for workers, by their token")


FORM = 64 << 10
"""Bytes of a form, and of all else that is no file."""
FILES = "takes_files"
"""Option of the routes that take files, and long reports, of those who have a name or a token."""
PARSED_AT_ONCE = b"application/x-www-form-urlencoded"


class Bodies:
    """Refuses a body that is too large before anything reads it, or as soon as too much of it has come.

    Parameters
    ----------
    largest : int
        Bytes of a file.
    """

    def __init__(self, app: ASGIApp, largest: int) -> None:
        self._app, self._largest = app, largest

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Hand on a request, of whose body no more than it may have is received."""
        most, come = self._most(scope), 0
        length = dict(scope["headers"]).get(b"content-length", b"0")
        if not length.isdigit():
            raise ClientException("content-length: not a number")
        if int(length[:20]) > most:
            raise _too_large(most)

        async def bounded() -> HTTPReceiveMessage | WebSocketReceiveMessage:
            nonlocal come
            message = await receive()
            if message["type"] == "http.request":
                come += len(message["body"])
                if come > most:
                    raise _too_large(most)
            return message

        await self._app(scope, bounded, send)

    def _most(self, scope: Scope) -> int:
        kind = dict(scope["headers"]).get(b"content-type", b"").lower()
        known = "user" in scope and scope["user"] != Viewer()
        takes = known and scope["route_handler"].opt.get(FILES, False)
        return self._largest if takes and PARSED_AT_ONCE not in kind else FORM


def _too_large(most: int) -> RequestEntityTooLarge:
    return RequestEntityTooLarge(f"the body is larger than {most >> 10} KiB")
