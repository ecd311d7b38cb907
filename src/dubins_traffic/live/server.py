"""The server of the page: a thread beside the trial that answers browsers and sends each the log at its own pace."""

from __future__ import annotations

import asyncio
import json
import logging
import socket
from collections.abc import Callable
from contextlib import suppress
from threading import Event, Thread
from time import monotonic
from typing import Any, Final
from urllib.parse import parse_qs, urlsplit

from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from dubins_traffic.live.access import Access, Door, RefusedError
from dubins_traffic.live.player import Wheel
from dubins_traffic.live.show import Show
from dubins_traffic.viewer.pages import part
from dubins_traffic.viewer.replay import page_of

MOST_BYTES: Final = 256
"""Most bytes of a message from a page."""
MOST_RATE: Final = 120.0
"""Most messages a second from a page, in the long run."""
BURST: Final = 240.0
"""Most messages at once."""
MOST_PAGES: Final = 32
"""Most pages at a time."""
FLUSH_S: Final = 5.0
"""Seconds within which pages are sent the rest when the program ends."""
REFUSED: Final = 1008
"""Code of a connection closed since its page sent what no page sends."""
HEADERS: Final = {
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "X-Frame-Options": "DENY",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}
SCRIPTS: Final = ("live.js", "drive.js")
NEXT: Final = '{"kind":"next"}'
"""Tells a page that there is another trial, which it gets by loading itself again."""


class Server:
    """Serves the page of the present trial, and its socket, until it is closed.

    Parameters
    ----------
    opened : socket
        Where it listens.
    access : Access
        Who is let in.
    wheel : Wheel, optional
        What the player's page asks for goes there; without, all look on.
    """

    def __init__(self, opened: socket.socket, access: Access, wheel: Wheel | None = None) -> None:
        self._socket, self._access, self._wheel = opened, access, wheel
        self._show: Show | None = None
        self._pages: dict[ServerConnection, asyncio.Event] = {}
        self._came = Event()
        self._ready = Event()
        self._closing = False
        self._thread = Thread(target=lambda: asyncio.run(self._serve()), name="live pages", daemon=True)
        self._thread.start()
        self._ready.wait()

    def present(self, show: Show) -> None:
        """Show a trial from now on."""
        self._show = show
        self.ring()

    def ring(self) -> None:
        """Let all pages be sent what is new in the log."""
        self._call(self._wake)

    def wait_for_page(self) -> None:
        """Return when a page has been opened."""
        while not self._came.wait(3600.0):
            pass

    def close(self) -> None:
        """Send all pages the rest, within `FLUSH_S`, and end."""
        if not self._thread.is_alive():
            return
        self._closing = True
        self.ring()
        self._thread.join(FLUSH_S)
        self._call(self._stop.set)
        self._thread.join()

    def _call(self, function: Callable[[], object]) -> None:
        """Let the thread of the server call a function, unless it has ended."""
        with suppress(RuntimeError):
            self._loop.call_soon_threadsafe(function)

    async def _serve(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._stop = asyncio.Event()
        log = logging.getLogger(__name__)
        log.addHandler(logging.NullHandler())
        log.propagate = False  # what strangers send is no matter for the terminal
        async with serve(
            self._hold,
            sock=self._socket,
            process_request=self._answer,
            compression=None,
            server_header=None,
            max_size=MOST_BYTES,
            max_queue=8,
            open_timeout=30.0,
            close_timeout=2.0,
            logger=log,
        ):
            self._ready.set()
            await self._stop.wait()

    def _wake(self) -> None:
        for news in self._pages.values():
            news.set()
        if self._closing and not self._pages:
            self._stop.set()

    def _answer(self, _connection: ServerConnection, request: Request) -> Response | None:
        """Answer a request with the page; None lets it open the socket."""
        if getattr(request, "method", "GET") != "GET":  # earlier versions of websockets let nothing else through
            return _response(405, "the page is there to be read", "text/plain", {"Allow": "GET"})
        try:
            door = self._access.admit(request.path, request.headers)
        except RefusedError as error:
            return _response(error.status, error.text, "text/plain")
        if door is Door.EXCHANGE:
            return _response(303, "", "text/plain", {"Location": "/", "Set-Cookie": self._access.cookie})
        show = self._show
        if show is None:
            return _response(503, "The trial has not begun yet.", "text/plain", {"Refresh": "1"})
        if door is Door.PAGE:
            return _response(200, self._page(show, request.headers["Host"]), "text/html")
        if len(self._pages) >= MOST_PAGES:
            return _response(503, f"there are {MOST_PAGES} pages, and no room for more", "text/plain")
        return None

    def _page(self, show: Show, host: str) -> str:
        scripts = [part(f"live/{name}") for name in SCRIPTS]
        plays = self._wheel is not None
        style = part("live/live.css")
        return page_of(show.document, template="live/live.html", style=style, scripts=scripts, host=host, plays=plays)

    async def _hold(self, connection: ServerConnection) -> None:
        """Serve one page until it goes, or has been sent everything."""
        news = self._pages[connection] = asyncio.Event()
        seat = _Seat(self._wheel)
        tasks = {
            asyncio.ensure_future(self._send(connection, news)),
            asyncio.ensure_future(seat.listen(connection)),
        }
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            seat.leave()
            del self._pages[connection]
            self._wake()

    async def _send(self, connection: ServerConnection, news: asyncio.Event) -> None:
        """Send a page the log of its trial; afterwards tell it that there is another."""
        show = self._show
        if show is None or _number(connection) != show.number:
            await connection.send(NEXT)
            return
        self._came.set()
        place, told = 0, False
        while not told:
            news.clear()
            messages, place, told = show.after(place)
            for message in messages:
                await connection.send(message)
            if not messages and not told:
                await news.wait()
        while show is self._show and not self._closing:
            news.clear()
            await news.wait()
        if show is not self._show:
            await connection.send(NEXT)


class _Seat:
    """What one page sends: who it is and, if it is the player's, how to drive."""

    def __init__(self, wheel: Wheel | None) -> None:
        self._wheel = wheel
        self._who: str | None = None
        self._drives = False
        self._left, self._at = BURST, monotonic()

    async def listen(self, connection: ServerConnection) -> None:
        """Hear all that comes; a page that sends too much, or what no page sends, is closed."""
        with suppress(ConnectionClosed):
            async for message in connection:
                try:
                    told = self._hear(message)
                except ValueError as error:
                    await connection.close(REFUSED, str(error))
                    return
                if told is not None:
                    await connection.send(json.dumps(told))

    def leave(self) -> None:
        """Give the wheel back."""
        if self._wheel is not None and self._who is not None and self._drives:
            self._wheel.leave(self._who)

    def _hear(self, message: str | bytes) -> dict[str, Any] | None:
        """Do what a message asks for; return what the page is told.

        Raises
        ------
        ValueError
            If no page sends this, or not so often.
        """
        now = monotonic()
        self._left = min(BURST, self._left + MOST_RATE * (now - self._at)) - 1.0
        self._at = now
        if self._left < 0.0:
            raise ValueError("too many messages")
        if not isinstance(message, str):
            raise ValueError("not a text")
        try:
            given = json.loads(message)
        except RecursionError:
            raise ValueError("not a message") from None
        match given:
            case {"who": str() as who} if len(given) == 1 and self._who is None:
                self._who = who
                self._drives = self._wheel is not None and self._wheel.take(who)
                return {"kind": "role", "drives": self._drives}
            case dict() if self._wheel is not None and self._drives:
                self._wheel.hear(given)
                return None
            case _:
                raise ValueError("no message of a page")


def _number(connection: ServerConnection) -> int:
    """Return the number of the trial that a page shows, 0 if it says none."""
    request = connection.request
    given = "" if request is None else parse_qs(urlsplit(request.path).query).get("show", [""])[0]
    return int(given) if given.isdecimal() and len(given) < 10 else 0


def _response(status: int, text: str, kind: str, more: dict[str, str] | None = None) -> Response:
    body = text.encode()
    headers = {
        "Connection": "close",
        "Content-Length": str(len(body)),
        "Content-Type": f"{kind}; charset=utf-8",
        **HEADERS,
        **(more or {}),
    }
    return Response(status, _REASONS.get(status, "Error"), Headers(headers), body)


_REASONS = {200: "OK", 303: "See Other", 503: "Service Unavailable"}
