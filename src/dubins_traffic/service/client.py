"""What participants do from a terminal: hand in, look on, read logs, cancel; fetch a competition to evaluate at home.

A phase is named by the address of its page, ``https://host/c/COMPETITION/PHASE``, a submission by ``https://host/s/7``.
"""

from __future__ import annotations

import io
import re
import time
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dubins_traffic.competition.competition import Competition
from dubins_traffic.competition.contents import Bounds, folder_files
from dubins_traffic.errors import InputError
from dubins_traffic.files import read_bytes
from dubins_traffic.service.connection import Connection

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

    Raises
    ------
    InputError
        If it is not such an address.
    """
    found = _COMPETITION.fullmatch(url)
    if found is None:
        raise InputError(
            "no address of a competition", value=url, expected="https://host/c/COMPETITION/PHASE"
        )
    return Address(found[1], f"/api/competitions/{found[2]}"), found[3]


def phase_at(url: str) -> Address:
    """Return where the submissions of a phase are; InputError if the address is not that of a phase."""
    competition, phase = competition_at(url)
    if phase is None:
        raise InputError("the address names no phase", value=url, expected="https://host/c/COMPETITION/PHASE")
    return Address(competition.host, f"{competition.path}/phases/{phase}/submissions")


def submission_at(url: str) -> Address:
    """Return where a submission is by the address of its page; InputError if it is no such address."""
    found = _SUBMISSION.fullmatch(url)
    if found is None:
        raise InputError("no address of a submission", value=url, expected="https://host/s/NUMBER")
    return Address(found[1], f"/api/submissions/{found[2]}")


def fetched_competition(url: str) -> Competition:
    """Return the competition at an address, to evaluate at home.

    Raises
    ------
    InputError
        If there is none there.
    AwayError
        If the service does not answer.
    """
    asked, _ = competition_at(url)
    return Competition.from_document(asked.connection().get(f"{asked.path}/file"), url)


def packed(path: Path) -> tuple[str, bytes]:
    """Return the name and the bytes of what is handed in; a folder becomes a zip archive, always of the same bytes.

    Raises
    ------
    InputError
        If it can't be read, or holds what no submission may hold.
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

    Raises
    ------
    InputError
        If the service refuses it: a closed phase, a quota that is used up, no team.
    AwayError
        If the service does not answer.
    """
    asked = phase_at(url)
    name, data = packed(path)
    told = asked.connection(token).upload(asked.path, name, data)
    return f"{asked.host}/s/{told['id']}", told


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
        told = status(url, token)
        if not told["active"]:
            return told
        time.sleep(pause)
