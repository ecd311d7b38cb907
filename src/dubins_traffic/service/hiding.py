"""What comes of a phase that does not show all, hidden from whoever reads the database, the store or a copy of them.

Results, logs, tables and replays of such a phase are written encrypted (AES-256-GCM) and stay so; they are read with a
key of the phase, which scrypt derives from that of the secret seeds. That key lies outside the folder of the service.
"""

from __future__ import annotations

import base64
import json
import secrets
from collections.abc import Mapping
from typing import Any, Final, TypeVar, cast

from cryptography.exceptions import InvalidTag

from dubins_traffic.competition.sealing import cipher_of
from dubins_traffic.errors import DubinsTrafficError
from dubins_traffic.service.database_tables import Chunk, Standing, Trial

NONCE: Final = 12
HIDDEN: Final = {Trial: ("row", "end", "owner", "frames", "ran", "again"), Standing: ("places",)}
"""Columns that are hidden together."""
Row = TypeVar("Row", Trial, Standing)


class HiddenError(DubinsTrafficError):
    """What is hidden can't be read: the service has another key, or it has been changed."""


class Hiding:
    """Hides and shows what comes of one phase.

    Parameters
    ----------
    cipher : AESGCM or None
        Of the phase; None hides nothing.
    """

    def __init__(self, cipher: Any | None) -> None:
        self._cipher = cipher

    def hide(self, data: bytes, what: str) -> bytes:
        """Return bytes as they are kept; `what` says of what they are, and they can be shown as nothing else."""
        if self._cipher is None:
            return data
        nonce = secrets.token_bytes(NONCE)
        return nonce + self._cipher.encrypt(nonce, data, what.encode())

    def show(self, data: bytes, what: str) -> bytes:
        """Return what `hide` was given.

        HiddenError if the key is another, or the bytes have been changed or belong to something else.
        """
        if self._cipher is None:
            return data
        try:
            return self._cipher.decrypt(data[:NONCE], data[NONCE:], what.encode())
        except (InvalidTag, ValueError):
            raise HiddenError(f"{what}: can't be decrypted: another key (--key-file), or changed") from None

    def keep(self, row: Trial | Standing, values: Mapping[str, Any], log: str | None = None) -> None:
        """Set columns of a row, hidden together; those that were set before stay. The log is hidden alone."""
        if self._cipher is None:
            for name, value in values.items():
                setattr(row, name, value)
        else:
            text = json.dumps({**self._known(row), **values}, allow_nan=False)
            row.hidden = self.hide(text.encode(), _what(row))
        if isinstance(row, Trial) and log is not None:
            packed = base64.b64encode(self.hide(log.encode(), f"log of {_what(row)}")).decode()
            row.log = log if self._cipher is None else packed

    def shown(self, row: Row, *, logs: bool = False) -> Row:
        """Return a row as it was before it was hidden; a copy, which is not in the database. Logs, if asked for."""
        if row.hidden is None:
            return row
        if isinstance(row, Standing):
            twin = Standing(phase_id=row.phase_id, at=row.at, version=row.version, **self._known(row))
            return cast("Row", twin)
        same = {name: getattr(row, name) for name in ("submission_id", "run", "number", "replay", "own_replay")}
        twin_trial = Trial(**same, **self._known(row))
        if logs:
            packed = base64.b64decode(row.log)
            twin_trial.log = self.show(packed, f"log of {_what(row)}").decode(errors="replace")
        return cast("Row", twin_trial)

    def _known(self, row: Trial | Standing) -> dict[str, Any]:
        if row.hidden is None:
            return {name: getattr(row, name) for name in HIDDEN[type(row)]}
        return json.loads(self.show(row.hidden, _what(row)))


NOTHING: Final = Hiding(None)
"""Of phases that show all."""


def hiding_of(key: bytes, phase: str) -> Hiding:
    """Return what hides a phase that is called COMPETITION/NAME, with the key of secret seeds."""
    return Hiding(cipher_of(key, f"results of {phase}".encode()))


def replays_of(row: Trial | Chunk) -> str:
    """Return what the replays of a run of a submission are called where they are hidden."""
    return f"replay of submission {row.submission_id}, run {row.run}"


def _what(row: Trial | Standing) -> str:
    if isinstance(row, Standing):
        return f"table {row.version} of phase {row.phase_id}"
    return f"trial {row.number} of submission {row.submission_id}, run {row.run}"
