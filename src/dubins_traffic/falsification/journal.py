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
Finished = tuple[int, "Genome", Tried]
"""The number of a trial, its genome, and what came of it."""


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
        self._waiting: list[Finished] = []
        self._written = time.monotonic()
        told = read_bytes(path).decode(errors="replace").splitlines(keepends=True) if path.is_file() else []
        for line in told:
            checksum, _, text = line.partition(" ")
            if checksum == _checksum(text):
                number, digest, _ = json.loads(text)
                self._lines[number, digest] = line
        self._sound = 0 < len(self._lines) == len(told)

    def known(self, number: int, genome: Genome) -> Tried | None:
        """Return what came of a trial; None if it is not here."""
        line = self._lines.get(_key(number, genome)) if self._lines else None
        return None if line is None else Tried.from_json(json.loads(line.partition(" ")[2])[2])

    def keep(self, finished: Iterable[Finished]) -> None:
        """Keep trials that are finished: at once if the last ones were written `KEPT_S` ago, else with the next ones.

        Raises
        ------
        InputError
            If the journal can't be written.
        """
        self._waiting += finished
        if time.monotonic() - self._written > KEPT_S:
            self._append()

    def taken(self) -> None:
        """A generation has been taken over: what of it is not written yet is left to the state that is written next."""
        self._waiting.clear()
        self._written = time.monotonic()

    def settle(self, trials: int) -> None:
        """Forget the first `trials` trials, which the state knows, and write down all others.

        Raises
        ------
        InputError
            If the journal can't be written.
        """
        self._take_lines()
        self._lines = {key: line for key, line in self._lines.items() if key[0] >= trials}
        self._write()

    def _take_lines(self) -> str:
        """Return the lines of what waits, which are lines like the others from now on."""
        lines: list[str] = []
        for number, genome, tried in self._waiting:
            key = _key(number, genome)
            text = json.dumps([*key, tried.to_json()]) + "\n"
            self._lines[key] = line = f"{_checksum(text)} {text}"
            lines.append(line)
        self._waiting.clear()
        return "".join(lines)

    def _append(self) -> None:
        """Write what waits behind the lines that are there, if all are as they were written."""
        lines = self._take_lines()
        if not self._sound:
            self._write()
            return
        try:
            with self._path.open("ab") as file:
                file.write(lines.encode())
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise InputError(f"can't be written ({error.strerror})", file=str(self._path)) from error
        self._written = time.monotonic()

    def _write(self) -> None:
        """Write all lines anew."""
        if self._lines:
            write_text(self._path, "".join(self._lines.values()), durable=True)
        else:
            self._path.unlink(missing_ok=True)
        self._sound = bool(self._lines)
        self._written = time.monotonic()


def _checksum(text: str) -> str:
    return f"{zlib.crc32(text.encode()):08x}"


def _key(number: int, genome: Genome) -> Key:
    return number, hashlib.sha256(json.dumps(genome.to_json()).encode()).hexdigest()
