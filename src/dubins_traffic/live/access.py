"""Who may open the page of a running trial, and its socket.

The page is for browsers of this machine that were given its address. Another site that such a browser shows must
neither read it nor drive the ego: its requests carry another Host (where a name was made to lead here) or another
Origin. The token in the address is exchanged for a cookie that no other site's request carries.
"""

from __future__ import annotations

import secrets
from collections.abc import Sequence
from enum import Enum
from typing import Protocol
from urllib.parse import parse_qs, urlsplit

HOSTS = ("127.0.0.1", "localhost")
"""Names of this machine that the page has."""
PAGE, SOCKET = "/", "/socket"
"""Paths of the page and of its socket."""
_BYTES = 32


class Headers(Protocol):
    """The headers of a request."""

    def get_all(self, key: str, /) -> Sequence[str]:
        """Return the values of a header, in any case of its name, in their order."""
        ...


class Door(Enum):
    """What a request is let in to: the exchange of a token for a cookie, the page, or its socket."""

    EXCHANGE = "exchange"
    PAGE = "page"
    SOCKET = "socket"


class RefusedError(Exception):
    """A request is not let in."""

    def __init__(self, status: int, text: str) -> None:
        super().__init__(text)
        self.status, self.text = status, text


class Access:
    """The secrets of one page, and who is let in by them.

    Parameters
    ----------
    port : int
        Where the page is.

    Attributes
    ----------
    token : str
        Opens the page as often as it is asked to, for who was told the address.
    """

    def __init__(self, port: int) -> None:
        self.token = secrets.token_urlsafe(_BYTES)
        self._once: list[str] = []
        self._key = secrets.token_urlsafe(_BYTES)
        # Cookies know no ports: two programs on one machine have two names for theirs.
        self._name = f"dubins-traffic-{port}"
        self._hosts = tuple(f"{name}:{port}" for name in HOSTS)

    def token_for_once(self) -> str:
        """Return a further token that opens the page once: others may read what a browser is started with."""
        self._once.append(secrets.token_urlsafe(_BYTES))
        return self._once[-1]

    @property
    def cookie(self) -> str:
        """The header that gives a browser the cookie: for this site alone, out of reach of scripts, until it closes."""
        return f"{self._name}={self._key}; Path=/; HttpOnly; SameSite=Strict"

    def admit(self, target: str, headers: Headers) -> Door:
        """Return what a request is let in to.

        Parameters
        ----------
        target : str
            Path and query of the request.
        headers : Headers
            Its headers.

        Raises
        ------
        RefusedError
            If it is not.
        """
        host = _only(headers, "Host")
        if host not in self._hosts:
            raise RefusedError(421, "this is not the host of this page")
        origins = headers.get_all("Origin")
        if list(origins) not in ([], [f"http://{host}"]):
            raise RefusedError(403, "another site asks for this page")
        parts = urlsplit(target)
        if parts.path == SOCKET and not origins:
            raise RefusedError(403, "only the page itself opens the socket")
        if parts.path not in (PAGE, SOCKET):
            raise RefusedError(404, "there is one page here, at /")
        given = parse_qs(parts.query).get("token", [])
        if parts.path == PAGE and given:
            self._take(given)
            return Door.EXCHANGE
        if not self._has_cookie(headers):
            raise RefusedError(403, "open the address that the program printed")
        return Door.PAGE if parts.path == PAGE else Door.SOCKET

    def _take(self, given: Sequence[str]) -> None:
        """Let a token in; one for once is used up."""
        if len(given) == 1:
            known = [token for token in (self.token, *self._once) if _equal(token, given[0])]
            if known:
                self._once = [token for token in self._once if token != known[0]]
                return
        raise RefusedError(403, "this address is not valid any more: open the one that the program printed")

    def _has_cookie(self, headers: Headers) -> bool:
        # Those of other programs at this address come along, in whatever form, so only names and values are told apart.
        given = [part.strip().partition("=") for line in headers.get_all("Cookie") for part in line.split(";")]
        return any(name == self._name and _equal(value, self._key) for name, _, value in given)


def _only(headers: Headers, name: str) -> str | None:
    values = headers.get_all(name)
    return values[0] if len(values) == 1 else None


def _equal(one: str, other: str) -> bool:
    return secrets.compare_digest(one.encode(), other.encode())
