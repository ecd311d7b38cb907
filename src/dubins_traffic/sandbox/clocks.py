"""The processor time of a box: of its control group, or of its processes by their own clocks.

By their clocks, what a process has used counts while it is there, and afterwards with its parent, which has waited for
it; what it uses between the last look and its end is lost only if nobody waits for it, which the filter of system calls
sees to (`seccomp.program`).
"""

from __future__ import annotations

import os
from pathlib import Path
from time import clock_gettime, monotonic
from typing import Final

LOOK: Final = 0.02
"""Seconds between two looks at all processes."""
_TICK: Final = 1.0 / os.sysconf("SC_CLK_TCK")
_PAGE: Final = os.sysconf("SC_PAGE_SIZE")


class ProcessClocks:
    """Counts processor time and memory of a process and all that descend from it.

    Parameters
    ----------
    first : int
        The process from which all others of the box descend.
    """

    def __init__(self, first: int) -> None:
        self._first = first
        self._looked = -1.0
        self._seconds = 0.0
        self.memory = 0
        """Bytes that the processes held in memory at the last look."""
        self.processes = 0
        """How many there were."""

    def seconds(self, *, now: bool = False) -> float:
        """Return the processor time so far, as of the last look, which is a few hundredths of a second ago at most."""
        if now or monotonic() - self._looked > LOOK:
            self._look()
        return self._seconds

    def _look(self) -> None:
        self._looked = monotonic()
        total, memory, seen = 0.0, 0, 0
        waiting = [self._first]
        while waiting:
            process = waiting.pop()
            found = _stat(process)
            if found is None:
                continue
            seconds, pages = found
            total, memory, seen = total + seconds, memory + pages * _PAGE, seen + 1
            waiting += children(process)
        self._seconds = max(self._seconds, total)
        self.memory, self.processes = memory, seen


def _stat(process: int) -> tuple[float, int] | None:
    """Return the processor time of a process and its children that are gone, and its pages in memory."""
    try:
        data = Path(f"/proc/{process}/stat").read_bytes()
    except OSError:
        return None
    parts = data.rpartition(b")")[2].split()
    user, system, gone_user, gone_system = (int(part) for part in parts[11:15])
    exact = _exact(process)
    own = (user + system) * _TICK if exact is None else exact
    return own + (gone_user + gone_system) * _TICK, int(parts[21])


def _exact(process: int) -> float | None:
    """Return the processor time of a process by its clock, to the nanosecond."""
    try:
        return clock_gettime((~process << 3) | 2)
    except OSError:
        return None


def children(process: int) -> list[int]:
    """Return the numbers of the processes that a process has begun and that are there."""
    found: list[int] = []
    try:
        for thread in Path(f"/proc/{process}/task").iterdir():
            found += map(int, (thread / "children").read_text().split())
    except OSError:
        return found
    return found
