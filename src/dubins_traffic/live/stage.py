"""A page for trials that run here: it listens, lets a browser open the page, and feeds it while the trials run."""

from __future__ import annotations

import webbrowser
from collections.abc import Callable
from threading import Thread
from types import TracebackType
from typing import Final, Self

from dubins_traffic.errors import InputError
from dubins_traffic.live.access import HOSTS, Access
from dubins_traffic.live.feed import Feed
from dubins_traffic.live.listening import address_of, listen
from dubins_traffic.live.player import Player, Wheel
from dubins_traffic.live.server import Server
from dubins_traffic.live.show import Show

MOST_PACE: Final = 1000.0
"""Most seconds of a trial in a second."""


class Stage:
    """The page, from before the first trial until all that is to be told has been sent.

    Parameters
    ----------
    tell : callable
        Is told the address, in a sentence.
    port : int
        Where the page is; 0: any port that is free.
    opens : bool
        Whether a browser is asked to open the page.
    pace : float
        Seconds of a trial in a second.
    plays : bool
        Whether a person drives the ego there.

    Attributes
    ----------
    feed : Feed
        The watcher of the trials.
    wheel : Wheel
        What the person asks for, if one drives.

    Raises
    ------
    InputError
        If the port is taken, or there is no browser that could be asked.
    """

    def __init__(
        self,
        tell: Callable[[str], object],
        port: int = 0,
        *,
        opens: bool = True,
        pace: float = 1.0,
        plays: bool = False,
    ) -> None:
        if not 0.0 < pace <= MOST_PACE:
            raise InputError("not a pace", file="--pace", value=pace, expected=f"a number > 0, at most {MOST_PACE:g}")
        self._browser = _browser() if opens else None
        self._tell = tell
        opened = listen(HOSTS[0], port)
        self._url = address_of(opened)
        self._access = Access(opened.getsockname()[1])
        self.wheel = Wheel()
        self._plays = plays
        self._server = Server(opened, self._access, self.wheel if plays else None)
        self._is_told = False
        self.feed = Feed(self, pace, plays=plays)

    @property
    def player(self) -> Player:
        """The controller of the person."""
        return Player(self.wheel)

    def present(self, show: Show) -> None:
        """Show a trial from now on; of the first, tell where."""
        self._server.present(show)
        if self._is_told:
            return
        self._is_told = True
        what = "Play" if self._plays else "Watch"
        self._tell(f"{what} at {self._url}/?token={self._access.token}")
        if self._browser is not None:
            url = f"{self._url}/?token={self._access.token_for_once()}"
            # Some browsers only come back when they end.
            Thread(target=self._browser.open, args=(url,), name="browser", daemon=True).start()

    def ring(self) -> None:
        """Let all pages be sent what is new."""
        self._server.ring()

    def wait(self) -> None:
        """Return when there is a page or, if a person drives, when he has begun to."""
        if self._plays:
            self.wheel.wait()
        else:
            self._server.wait_for_page()

    def close(self) -> None:
        """Send all pages what is left for them, and end."""
        self.feed.finish()
        self._server.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        _kind: type[BaseException] | None,
        _error: BaseException | None,
        _traceback: TracebackType | None,
    ) -> None:
        self.close()


def _browser() -> webbrowser.BaseBrowser:
    try:
        return webbrowser.get()
    except webbrowser.Error:
        raise InputError(
            "there is no browser here that could show the page",
            expected="--no-browser, which prints the address for one elsewhere",
        ) from None
