"""Sessions of who has logged in: nothing is kept of others, and none outlives its log-in or keeps an older one's id."""

from __future__ import annotations

import contextlib
from typing import Any

from litestar.connection import ASGIConnection
from litestar.middleware.session.server_side import ServerSideSessionBackend, ServerSideSessionConfig
from litestar.stores.base import StorageObject
from litestar.stores.file import FileStore
from litestar.types import Empty, Message
from msgspec import MsgspecError

LOADED = "loaded_session"
"""Where the state of a request holds what its session was when it came."""


class Sessions(ServerSideSessionBackend):
    """Keeps a session under an id that is drawn when its content is set, and forgets what was kept under the old one.

    A session that has not changed is not written: an answer that comes late does not bring back what has ended.
    """

    def get_session_id(self, connection: ASGIConnection[Any, Any, Any, Any]) -> str:  # noqa: ARG002
        """Return a new id; that of the request's cookie serves to find a session alone."""
        return self.generate_session_id()

    async def load_from_connection(self, connection: ASGIConnection[Any, Any, Any, Any]) -> dict[str, Any]:
        """Return the session of a request, and remember it."""
        found = await super().load_from_connection(connection)  # pyright: ignore[reportUnknownMemberType]
        connection.scope["state"][LOADED] = dict(found)
        return found

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
