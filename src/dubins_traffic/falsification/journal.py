"""The trials that a search has finished since it last wrote down where it goes on: none of them is run again."""

from __future__ import annotations

import hashlib
import json
import os
import time
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from dubins_traffic.campaign.chunks import KEPT_S
from dubins_traffic.errors import InputError
from dubins_traffic.falsification.trying import Tried
from dubins_traffic.files import read_bytes, write_text

if TYPE_CHECKING:
    from dubins_traffic.falsification.genome import Genome

Key = tuple[int, str]
"""The number of a trial, and the hash of its genome."""


class Journal:
    """What came of the trials that are finished and not yet part of the state of a search, a line each.

    A trial is known by its number and the hash of its genome: another one of that number is run. A line begins with its
    checksum; what is not as it was written, such as a last line that was cut off, is passed over, and its trial run.

    Parameters
    ----------
    path : Path
        The file, which need not be there.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lines: dict[Key, str] = {}
        self._waiting: list[str] = []
        self._written = time.monotonic()
        told = read_bytes(path).decode(errors="replace").splitlines(keepends=True) if path.is_file() else []
        for line in told:
            checksum, _, text = line.partition(" ")
            if checksum == _checksum(text):
                number, digest, _ = json.loads(text)
                self._lines[number, digest] = line
        self._sound = 0 < len(self._lines) == len(told)

    def known(self, key: Key) -> Tried | None:
        """Return what came of a trial; None if it has not been finished."""
        line = self._lines.get(key)
        return None if line is None else Tried.from_json(json.loads(line.partition(" ")[2])[2])

    def keep(self, finished: Iterable[tuple[Key, Tried]]) -> None:
        """Keep trials that are finished: at once if the last ones were written `KEPT_S` ago, else with the next ones.

        Raises
        ------
        InputError
            If the journal can't be written.
        """
        for key, tried in finished:
            text = json.dumps([*key, tried.to_json()]) + "\n"
            self._lines[key] = line = f"{_checksum(text)} {text}"
            self._waiting.append(line)
        if time.monotonic() - self._written > KEPT_S:
            self._append()

    def settle(self, trials: int) -> None:
        """Forget the first `trials` trials, which the state knows, and write down all others.

        Raises
        ------
        InputError
            If the journal can't be written.
        """
        self._lines = {key: line for key, line in self._lines.items() if key[0] >= trials}
        self._write()

    def _append(self) -> None:
        """Write what waits behind the lines that are there, if all are as they were written."""
        if not self._sound:
            self._write()
            return
        try:
            with self._path.open("ab") as file:
                file.write("".join(self._waiting).encode())
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise InputError(f"can't be written ({error.strerror})", file=str(self._path)) from error
        self._waiting.clear()
        self._written = time.monotonic()

    def _write(self) -> None:
        """Write all lines anew."""
        if self._lines:
            write_text(self._path, "".join(self._lines.values()), durable=True)
        else:
            self._path.unlink(missing_ok=True)
        self._sound = bool(self._lines)
        self._waiting.clear()
        self._written = time.monotonic()


def _checksum(text: str) -> str:
    return f"{zlib.crc32(text.encode()):08x}"


def key_of(number: int, genome: Genome) -> Key:
    """Return what a journal knows a trial by."""
    return number, hashlib.sha256(json.dumps(genome.to_json()).encode()).hexdigest()
