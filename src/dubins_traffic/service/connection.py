"""What clients and workers speak with a service: JSON over HTTP, with a token."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from dubins_traffic.errors import DubinsTrafficError, InputError, MissingExtraError, shown

if TYPE_CHECKING:
    import httpx

TIMEOUT_S = 60.0
PATIENCE_S = 600.0
"""How long a report is tried again while the service is away."""
TOKEN = "DUBINS_TRAFFIC_TOKEN"
"""The environment variable that holds the token of a client, and of a worker."""


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

    def patiently(self, method: str, path: str, document: Mapping[str, Any]) -> Any:
        """Send JSON, again and again while the service is away; what is sent must be safe to send twice."""
        until, pause = time.monotonic() + PATIENCE_S, 0.2
        while True:
            try:
                return self._ask(method, path, json=dict(document))
            except AwayError:
                if time.monotonic() > until:
                    raise
            time.sleep(pause)
            pause = min(10.0, 2.0 * pause)

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
