"""The application: routes, who may use them, what every answer carries, and the sessions of who has logged in.

Nothing is kept of others; no session outlives its log-in or keeps an older one's id.
"""

from __future__ import annotations

import contextlib
import secrets
from pathlib import Path
from typing import Any

import structlog
from litestar import Litestar, MediaType, Request, Response
from litestar.config.csrf import CSRFConfig
from litestar.connection import ASGIConnection
from litestar.di import Provide
from litestar.exceptions import HTTPException
from litestar.middleware import DefineMiddleware
from litestar.middleware.rate_limit import RateLimitConfig
from litestar.middleware.session.server_side import ServerSideSessionBackend, ServerSideSessionConfig
from litestar.openapi import OpenAPIConfig
from litestar.openapi.plugins import JsonRenderPlugin
from litestar.openapi.spec import Components, SecurityScheme
from litestar.plugins.jinja import JinjaTemplateEngine
from litestar.response import Redirect, Template
from litestar.static_files import create_static_files_router  # pyright: ignore[reportUnknownVariableType]
from litestar.stores.base import StorageObject
from litestar.stores.file import FileStore
from litestar.template import TemplateConfig
from litestar.types import Empty, Message
from msgspec import MsgspecError
from sqlalchemy.exc import DBAPIError

from dubins_traffic.errors import DubinsTrafficError
from dubins_traffic.service.accounts import WrongEntryError
from dubins_traffic.service.queue import StaleLeaseError
from dubins_traffic.service.receiving import UnknownError
from dubins_traffic.service.service import NoKeyError, Service, ServiceSettings
from dubins_traffic.service.storage import StorageError
from dubins_traffic.service.submissions import RefusedError
from dubins_traffic.service.texts import templates
from dubins_traffic.service.web import api, organisers, pages, worker_api
from dubins_traffic.service.web.pages import TEMPLATES
from dubins_traffic.service.web.requests import PROGRAMS, Bodies, Recognition, Viewer

LOADED = "loaded_session"
"""Where the state of a request holds what its session was when it came."""


class Sessions(ServerSideSessionBackend):
    """Keeps a session under an id that is drawn when its content is set, and forgets what was kept under the old one.

    A session that has not changed is not written: an answer that comes late does not bring back what has ended.
    """

    def get_session_id(self, connection: ASGIConnection[Any, Any, Any, Any]) -> str:  # noqa: ARG002
        """Return a new id for a session that is written; the id in the request's cookie only finds one."""
        return self.generate_session_id()

    async def load_from_connection(self, connection: ASGIConnection[Any, Any, Any, Any]) -> dict[str, Any]:
        """Return the session of a request, and remember it."""
        data = await super().load_from_connection(connection)  # pyright: ignore[reportUnknownMemberType]
        connection.scope["state"][LOADED] = dict(data)
        return data

    async def store_in_message(
        self, scope_session: Any, message: Message, connection: ASGIConnection[Any, Any, Any, Any]
    ) -> None:
        """End the session of the request and begin another, if it has changed."""
        if scope_session is not Empty and scope_session == connection.scope["state"].get(LOADED):
            return
        known = connection.cookies.get(self.config.key)
        if known:
            await self.delete(known, self.config.get_store_from_app(connection.scope["litestar_app"]))
        await super().store_in_message(scope_session, message, connection)  # pyright: ignore[reportUnknownMemberType]


class SessionFiles(FileStore):
    """Sessions in files."""

    async def delete_expired(self) -> None:
        """Remove what has expired; a file that is no session, such as one of a desktop, is left where it is."""
        async for path in self.path.iterdir():
            with contextlib.suppress(MsgspecError, OSError):
                if StorageObject.from_bytes(await path.read_bytes()).expired:
                    await path.unlink(missing_ok=True)


class SessionConfig(ServerSideSessionConfig):
    """The settings of `Sessions`."""

    _backend_class = Sessions


log = structlog.get_logger("dubins_traffic.service")
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "form-action 'self'; frame-src 'self'; base-uri 'none'; frame-ancestors 'none'"
)
HEADERS = {
    "content-security-policy": POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
}
WITHOUT_SESSION = [*(f"^{path}" for path in PROGRAMS), "^/static/"]
"""Where no cookie is read: patterns of paths."""
GUESSES = ("/login", "/join", "/reset", "/team/password", "/team/remove")
"""Where a password or a code is tried."""
STATUS = {
    NoKeyError: 503,
    WrongEntryError: 400,
    UnknownError: 404,
    RefusedError: 409,
    StaleLeaseError: 409,
    StorageError: 503,
    DBAPIError: 503,
    DubinsTrafficError: 400,
}


def create_app(service: Service) -> Litestar:
    """Return the application of a service."""
    settings = service.settings
    largest = (max(settings.largest_upload, settings.largest_replay) << 20) + (1 << 20)

    async def give_service() -> Service:
        return service

    handlers = (pages.Pages, pages.Submitting, pages.Login, pages.Teams, organisers.Organisers, api.Api)
    files = create_static_files_router("/static", [Path(__file__).with_name("static")], include_in_schema=False)
    kept = SessionFiles(service.folder / "sessions", create_directories=True)
    return Litestar(
        route_handlers=[*handlers, worker_api.WorkerApi, api.metrics, files],
        dependencies={"service": Provide(give_service), "viewer": Provide(_viewer)},
        middleware=_middleware(settings, largest),
        csrf_config=CSRFConfig(
            service.cookie_secret,
            cookie_name=f"{_prefix(settings)}csrf",
            cookie_secure=settings.secure,
            cookie_httponly=True,
            exclude=WITHOUT_SESSION,
        ),
        template_config=TemplateConfig(instance=JinjaTemplateEngine.from_environment(templates())),
        stores={"sessions": kept},
        on_startup=[kept.delete_expired],
        exception_handlers=dict.fromkeys((HTTPException, Exception, *STATUS), _answer_to),  # pyright: ignore[reportArgumentType]
        after_request=_with_headers,
        request_max_body_size=largest,
        logging_config=None,
        openapi_config=_described(settings.name),
        state=_state(service),
    )


def _prefix(settings: ServiceSettings) -> str:
    """Return what cookies are called by that no other host can set; without https there is no such name."""
    return "__Host-" if settings.secure else ""


def _middleware(settings: ServiceSettings, largest: int) -> list[Any]:
    guessing = RateLimitConfig(
        rate_limit=("minute", settings.logins), check_throttle_handler=_is_guess, set_rate_limit_headers=False
    )
    sessions = SessionConfig(
        key=f"{_prefix(settings)}session",
        secure=settings.secure,
        samesite="lax",
        max_age=14 * 86400,
        exclude=WITHOUT_SESSION,
    )
    recognition = DefineMiddleware(Recognition, exclude=["^/static/"])
    bodies = DefineMiddleware(Bodies, largest=largest)
    return [guessing.middleware, sessions.middleware, recognition, bodies]


def _state(service: Service) -> Any:
    from litestar.datastructures import State

    return State({"service": service})


async def _viewer(request: Request[Any, Any, Any]) -> Viewer:
    return request.user


def _is_guess(request: Request[Any, Any, Any]) -> bool:
    """Whether a request tries a password or a code."""
    return request.method == "POST" and request.url.path.rstrip("/") in GUESSES


def _described(name: str) -> OpenAPIConfig:
    return OpenAPIConfig(
        title=f"{name}: competitions",
        version="1",
        path="/api",
        render_plugins=[JsonRenderPlugin(path="/openapi.json")],
        components=Components(security_schemes={"token": SecurityScheme(type="http", scheme="bearer")}),
        security=[{"token": []}],
    )


async def _with_headers(response: Response[Any]) -> Response[Any]:
    for name, value in HEADERS.items():
        response.headers.setdefault(name, value)
    response.headers.setdefault("cache-control", "no-store")
    return response


def _answer_to(request: Request[Any, Any, Any], error: Exception) -> Response[Any]:
    """Return what went wrong: JSON to programs, a page to people; who is not logged in is led to the door.

    Of what nobody has foreseen they are told a number alone, and the log tells the rest under that.
    """
    known = (HTTPException, *STATUS)
    unforeseen = {} if isinstance(error, known) else {"number": secrets.token_hex(4), "exc_info": error}
    if isinstance(error, HTTPException):
        status, detail = error.status_code, error.detail
        if status < 500 and error.extra:
            detail = f"{detail}: {error.extra}"[:500]
    elif unforeseen:
        status, detail = 500, f"a fault of this service, which its log tells as {unforeseen['number']}"
    else:
        status = next(code for kind, code in STATUS.items() if isinstance(error, kind))
        detail = "the database is away" if isinstance(error, DBAPIError) else str(error)
    if status >= 500:
        log.error("request failed", path=request.url.path, status=status, error=str(error), **unforeseen)
    if request.url.path.startswith(PROGRAMS):
        return Response(
            {"status_code": status, "detail": detail},
            status_code=status,
            media_type=MediaType.JSON,
            headers=HEADERS,
        )
    if status == 401 and request.method == "GET":
        return Redirect("/login", headers=HEADERS)
    viewer = request.scope["user"] if "user" in request.scope else Viewer()
    service: Service = request.app.state["service"]
    return Template(
        f"{TEMPLATES}/error.html",
        context={
            "viewer": viewer,
            "site": service.settings.name,
            "status": status,
            "detail": detail,
            "title": f"Error {status}",
        },
        status_code=status,
        headers=HEADERS,
        media_type=MediaType.HTML,
    )
