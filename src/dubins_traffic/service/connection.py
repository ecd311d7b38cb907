"""What clients and workers speak with a service: JSON over HTTP, with a token."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, TypeVar

from dubins_traffic.errors import DubinsTrafficError, InputError, MissingExtraError, shown

if TYPE_CHECKING:
    import httpx

TIMEOUT_S = 60.0
PATIENCE_S = 600.0
"""How long a report is tried again while the service is away."""
TOKEN = "DUBINS_TRAFFIC_TOKEN"
"""The environment variable that holds the token of a client, and of a worker."""

Found = TypeVar("Found")


class AwayError(DubinsTrafficError):
    """The service does not answer, or answers with a fault of its own."""


class RefusalError(InputError):
    """The service refuses what was asked."""


class Connection:
    """Asks a service.

    Parameters
    ----------
    url : str
        Its address, as ``https://compete.example.org``.
    token : str
        Of the API; empty for what everybody may read.

    Raises
    ------
    MissingExtraError
        Without the extra `client`.
    InputError
        If the address is none.
    """

    def __init__(self, url: str, token: str = "") -> None:
        try:
            import httpx
        except ImportError as error:
            raise MissingExtraError("asking a service", "client") from error
        if not url.startswith(("http://", "https://")):
            raise InputError(
                "no address of a service", field="URL", value=url, expected="https://... or http://..."
            )
        headers = {"authorization": f"Bearer {token.strip()}"} if token else {}
        self._client: httpx.Client = httpx.Client(
            base_url=url.rstrip("/"), headers=headers, timeout=TIMEOUT_S
        )

    def close(self) -> None:
        """Hang up."""
        self._client.close()

    def get(self, path: str) -> Any:
        """Return the JSON at a path."""
        return self._ask("GET", path)

    def post(self, path: str, document: Mapping[str, Any]) -> Any:
        """Send JSON and return the answer; None if it is empty."""
        return self._ask("POST", path, json=dict(document))

    def put(self, path: str, data: bytes) -> Any:
        """Send bytes and return the answer."""
        return self._ask("PUT", path, content=data, headers={"content-type": "application/octet-stream"})

    def upload(self, path: str, name: str, data: bytes) -> Any:
        """Send a file as a form does, and return the answer."""
        return self._ask("POST", path, files={"file": (name, data, "application/octet-stream")})

    def fetch(self, path: str) -> bytes:
        """Return the bytes at a path."""
        return self._answer("GET", path).content

    def patiently(self, ask: Callable[[], Found], given_up: Callable[[], bool] = lambda: False) -> Found:
        """Return what is asked for, again and again while the service is away; it must be safe to ask twice.

        Parameters
        ----------
        ask : callable
            What asks, such as ``lambda: connection.get("/status")``.
        given_up : callable
            Says that nobody waits for the answer any more.

        Raises
        ------
        AwayError
            If the service stays away for `PATIENCE_S`, or the answer is given up.
        """
        until, pause = time.monotonic() + PATIENCE_S, 0.2
        while True:
            try:
                return ask()
            except AwayError:
                if time.monotonic() > until or given_up():
                    raise
            time.sleep(pause)
            pause = min(5.0, 2.0 * pause)

    def _ask(self, method: str, path: str, **given: Any) -> Any:
        answer = self._answer(method, path, **given)
        try:
            return answer.json() if answer.content else None
        except ValueError:
            raise AwayError(f"{self._client.base_url}{path}: not JSON; is this the service?") from None

    def _answer(self, method: str, path: str, **given: Any) -> httpx.Response:
        import httpx

        try:
            answer = self._client.request(method, path, **given)
        except httpx.HTTPError as error:
            raise AwayError(f"{self._client.base_url}: {error or type(error).__name__}") from None
        if answer.status_code >= 500 or answer.status_code == 429:
            raise AwayError(f"{self._client.base_url}{path}: status {answer.status_code}: {_detail(answer)}")
        if answer.status_code >= 300:
            raise RefusalError(_detail(answer), file=str(self._client.base_url))
        return answer


def _detail(answer: httpx.Response) -> str:
    try:
        return shown(str(answer.json()["detail"]), 300)
    except (ValueError, KeyError, TypeError):
        return f"status {answer.status_code}"


def token_from(file: str | None) -> str:
    """Return a token from a file, else from the environment.

    Raises
    ------
    InputError
        If there is none.
    """
    from dubins_traffic.files import read_text

    token = read_text(file) if file else os.environ.get(TOKEN, "")
    if not token.strip():
        raise InputError("no token", file="--token-file", expected=f"a file with a token, or one in {TOKEN}")
    return token.strip()
