"""What a program in a box prints: counted, and the last of it kept."""

from __future__ import annotations

from typing import Final

from dubins_traffic.errors import shown
from dubins_traffic.sandbox.launch import STANDS

TAIL: Final = 8192
"""Bytes that are kept."""
_STANDS: Final = f"{STANDS}\n".encode()


class Printed:
    """What has been printed so far: `count` bytes since the box `stands`."""

    def __init__(self) -> None:
        self.count = 0
        self.stands = False
        self._kept = bytearray()

    def add(self, data: bytes) -> None:
        """Take more."""
        self._kept += data
        if not self.stands:
            _, found, rest = self._kept.partition(_STANDS)
            if not found:
                return
            self.stands, self._kept, data = True, bytearray(rest), bytes(rest)
        self.count += len(data)
        del self._kept[:-TAIL]

    @property
    def tail(self) -> str:
        """The last of it, as lines that are safe to show."""
        lines = self._kept[-TAIL:].decode(errors="replace").splitlines()
        return "\n".join(shown(line) for line in lines)

    @property
    def last(self) -> str:
        """The last line."""
        return shown((self.tail.splitlines() or [""])[-1], 200)
