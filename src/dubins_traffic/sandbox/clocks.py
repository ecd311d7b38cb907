"""The processor time of a box: of its control group, or of its processes by their own clocks.

By their clocks, what a process has used counts while it is there, and afterwards with its parent, which has waited for
it; what it uses between the last look and its end is lost only if nobody waits for it, which the filter of system calls
sees to (`seccomp.program`).
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from time import clock_gettime, monotonic
from typing import Final

LOOK: Final = 0.02
"""Seconds between two looks at all processes."""
PIPE: Final = 1 << 16
"""Bytes that a pipe holds unless it is made larger."""
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
        self.processes: Sequence[int] = ()
        """Which there were."""

    def seconds(self, *, now: bool = False) -> float:
        """Return the processor time so far, as of the last look, which is a few hundredths of a second ago at most."""
        if now or monotonic() - self._looked > LOOK:
            self._look()
        return self._seconds

    def _look(self) -> None:
        self._looked = monotonic()
        total, memory, seen = 0.0, 0, list[int]()
        waiting = [self._first]
        while waiting:
            process = waiting.pop()
            found = _stat(process)
            if found is None:
                continue
            seconds, pages = found
            total, memory = total + seconds, memory + pages * _PAGE
            seen.append(process)
            waiting += children(process)
        self._seconds = max(self._seconds, total)
        self.memory, self.processes = memory, seen

    def buffers(self) -> int:
        """Return how many bytes the kernel holds at most in the pipes and sockets of the processes of the last look."""
        found: set[str] = set()
        unseen = 0
        for thread in (each for process in self.processes for each in _threads(process)):
            try:
                held = list((thread / "fd").iterdir())
            except PermissionError:
                unseen += _table(thread)
                continue
            except OSError:
                continue
            for each in held:
                with contextlib.suppress(OSError):
                    found.add(str(each.readlink()))
        sockets = unseen + sum(name.startswith("socket:") for name in found)
        return sockets * _socket() + sum(name.startswith("pipe:") for name in found) * PIPE


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


def _threads(process: int) -> list[Path]:
    """Return the threads of a process; each may have descriptors of its own, and the first may have ended."""
    try:
        return list(Path(f"/proc/{process}/task").iterdir())
    except OSError:
        return []


def _table(thread: Path) -> int:
    """Return how many descriptors a thread has room for that does not show which it holds; 0 if it has ended."""
    try:
        lines = (thread / "status").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return 0
    said = dict(line.split(":", 1) for line in lines if ":" in line)
    return 0 if said["State"].split()[0] in ("Z", "X") else int(said.get("FDSize", "0"))


@cache
def _socket() -> int:
    """Return how many bytes of memory a socket may hold: one message is taken while there is any room."""
    try:
        usual = int(Path("/proc/sys/net/core/wmem_default").read_text(encoding="ascii"))
    except (OSError, ValueError):
        usual = 212992
    return 2 * usual


def children(process: int) -> list[int]:
    """Return the numbers of the processes that a process has begun and that are there."""
    found: list[int] = []
    try:
        for thread in Path(f"/proc/{process}/task").iterdir():
            found += map(int, (thread / "children").read_text().split())
    except OSError:
        return found
    return found
