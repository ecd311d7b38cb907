"""What participants do from a terminal: hand in, look on, read logs, cancel; fetch a competition to evaluate at home.

Clients and workers speak with a service in JSON over HTTP, with a token.

A phase is named by the address of its page, ``https://host/c/COMPETITION/PHASE``, a submission by ``https://host/s/7``.
"""

from __future__ import annotations

import io
import os
import re
import time
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from dubins_traffic.competition.competition import Competition
from dubins_traffic.competition.submission import Bounds, folder_files
from dubins_traffic.errors import DubinsTrafficError, InputError, needs, shown
from dubins_traffic.files import read_bytes

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
        with needs("asking a service", "client"):
            import httpx
        if not url.startswith(("http://", "https://")):
            raise InputError("no address of a service", field="URL", value=url, expected="https://... or http://...")
        headers = {"authorization": f"Bearer {token.strip()}"} if token else {}
        self._client: httpx.Client = httpx.Client(base_url=url.rstrip("/"), headers=headers, timeout=TIMEOUT_S)

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
    """Return a token from a file, else from the environment; InputError if there is none."""
    from dubins_traffic.files import read_text

    token = read_text(file) if file else os.environ.get(TOKEN, "")
    if not token.strip():
        raise InputError("no token", file="--token-file", expected=f"a file with a token, or one in {TOKEN}")
    return token.strip()


_COMPETITION = re.compile(r"(https?://[^/]+)/c/([a-z0-9-]+)(?:/([a-z0-9-]+))?(?:/table)?/?")
_SUBMISSION = re.compile(r"(https?://[^/]+)/s/([0-9]{1,9})/?")
POLL_S = 2.0
OLDEST = (1980, 1, 1, 0, 0, 0)


@dataclass(frozen=True)
class Address:
    """A service and a path of its API."""

    host: str
    path: str

    def connection(self, token: str = "") -> Connection:
        """Return a connection to the service."""
        return Connection(self.host, token)


def competition_at(url: str) -> tuple[Address, str | None]:
    """Return where a competition is by the address of its page, and the phase if it is that of a phase.

    InputError if it is not such an address.
    """
    parts = _COMPETITION.fullmatch(url)
    if parts is None:
        raise InputError("no address of a competition", value=url, expected="https://host/c/COMPETITION/PHASE")
    return Address(parts[1], f"/api/competitions/{parts[2]}"), parts[3]


def phase_at(url: str) -> Address:
    """Return where the submissions of a phase are; InputError if the address is not that of a phase."""
    competition, phase = competition_at(url)
    if phase is None:
        raise InputError("the address names no phase", value=url, expected="https://host/c/COMPETITION/PHASE")
    return Address(competition.host, f"{competition.path}/phases/{phase}/submissions")


def submission_at(url: str) -> Address:
    """Return where a submission is by the address of its page; InputError if it is no such address."""
    parts = _SUBMISSION.fullmatch(url)
    if parts is None:
        raise InputError("no address of a submission", value=url, expected="https://host/s/NUMBER")
    return Address(parts[1], f"/api/submissions/{parts[2]}")


def fetched_competition(url: str) -> Competition:
    """Return the competition at an address, to evaluate at home.

    InputError if there is none there; AwayError if the service does not answer.
    """
    asked, _ = competition_at(url)
    return Competition.from_document(asked.connection().get(f"{asked.path}/file"), url)


def packed(path: Path) -> tuple[str, bytes]:
    """Return the name and the bytes of what is handed in; a folder becomes a zip archive, always of the same bytes.

    InputError if it can't be read, or holds what no submission may hold.
    """
    if not path.is_dir():
        return path.name, read_bytes(path)
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in sorted(folder_files(path, Bounds()).items()):
            archive.writestr(zipfile.ZipInfo(name, OLDEST), data, zipfile.ZIP_DEFLATED)
    return f"{path.resolve().name}.zip", made.getvalue()


def submit(url: str, path: Path, token: str) -> tuple[str, dict[str, Any]]:
    """Hand in a submission to the phase at an address; return the address of its page, and what may be seen of it.

    InputError if the service refuses it: a closed phase, a quota that is used up, no team; AwayError if the service
    does not answer.
    """
    asked = phase_at(url)
    name, data = packed(path)
    submission = asked.connection(token).upload(asked.path, name, data)
    return f"{asked.host}/s/{submission['id']}", submission


def status(url: str, token: str) -> dict[str, Any]:
    """Return what may be seen of the submission at an address; the errors are those of `submit`."""
    asked = submission_at(url)
    return asked.connection(token).get(asked.path)


def logs(url: str, token: str) -> dict[str, Any]:
    """Return the logs of a submission that may be seen; the errors are those of `submit`."""
    asked = submission_at(url)
    return asked.connection(token).get(f"{asked.path}/logs")


def cancel(url: str, token: str) -> dict[str, Any]:
    """Cancel a submission, and return what may be seen of it; the errors are those of `submit`."""
    asked = submission_at(url)
    return asked.connection(token).post(f"{asked.path}/cancel", {})


def wait(url: str, token: str, pause: float = POLL_S) -> dict[str, Any]:
    """Return what may be seen of a submission once it has ended; the errors are those of `submit`."""
    while True:
        submission = status(url, token)
        if not submission["active"]:
            return submission
        time.sleep(pause)
