"""How large the body of a request may be: that of a form little, that of a file what the settings say."""

from __future__ import annotations

from litestar.exceptions import ClientException
from litestar.exceptions.http_exceptions import RequestEntityTooLarge
from litestar.types import ASGIApp, HTTPReceiveMessage, Receive, Scope, Send
from litestar.types.asgi_types import WebSocketReceiveMessage

from dubins_traffic.service.web.viewer import Viewer

FORM = 64 << 10
"""Bytes of a form, and of all else that is no file."""
FILES = "takes_files"
"""Option of the routes that take files, and long reports, of those who have a name or a token."""
PARSED_AT_ONCE = b"application/x-www-form-urlencoded"


class Bodies:
    """Refuses a body that is too large before anything reads it, or as soon as too much of it has come.

    Parameters
    ----------
    app : ASGIApp
        What is asked then.
    largest : int
        Bytes of a file.
    """

    def __init__(self, app: ASGIApp, largest: int) -> None:
        self._app, self._largest = app, largest

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Hand on a request, of whose body no more than it may have is received."""
        most, come = self._most(scope), 0
        told = dict(scope["headers"]).get(b"content-length", b"0")
        if not told.isdigit():
            raise ClientException("content-length: not a number")
        if int(told[:20]) > most:
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
