"""Watches another process on the course: how far it is, the time it has had, and how it ends."""

from __future__ import annotations

import mmap
import signal
import struct
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic, sleep
from typing import Self

FAREWELL = 5.0
"""Seconds in which a program that is no longer needed must end."""
LOOK = 0.05
_PLACE = struct.Struct("<qdq")


class SharedProgress:
    """The trial, time to begin (s) and tick that a process has reached, in a file that outlives the process.

    Parameters
    ----------
    memory : mmap
        Shared by the process that says how far it is, and the one that wants to know.
    """

    def __init__(self, memory: mmap.mmap) -> None:
        self._memory = memory

    @classmethod
    @contextmanager
    def made(cls, path: Path) -> Generator[Self]:
        """Make the file `path` for another process, which has not begun yet."""
        path.write_bytes(_PLACE.pack(-1, 0.0, -1))
        with cls.opened(path) as place:
            yield place

    @classmethod
    @contextmanager
    def opened(cls, path: Path) -> Generator[Self]:
        """Open the file that another process has made."""
        with path.open("r+b") as file, mmap.mmap(file.fileno(), _PLACE.size) as memory:
            yield cls(memory)

    def put(self, trial: int, begin: float, tick: int) -> None:
        """Write how far this process is."""
        _PLACE.pack_into(self._memory, 0, trial, begin, tick)

    @property
    def trial(self) -> int:
        """Number of the trial, -1 before the first."""
        return int(_PLACE.unpack_from(self._memory)[0])

    @property
    def begin(self) -> float:
        """Time to begin of that trial, seconds."""
        return float(_PLACE.unpack_from(self._memory)[1])

    @property
    def tick(self) -> int:
        """Tick of that trial that is being answered, -1 before the first."""
        return int(_PLACE.unpack_from(self._memory)[2])


class Waited:
    """Seconds since this was made, without those in which processes wanted a processor and had none.

    Where the system does not tell that, these are the seconds of the clock.

    Parameters
    ----------
    pids : int
        The processes: the one that is waited for, and those that must do something before it can go on.
    """

    def __init__(self, *pids: int) -> None:
        self._tasks = list(map(_tasks_of, pids))
        self._began = monotonic()
        self._known: dict[Path, int] = {}
        self._queued = self._in_queue()

    def seconds(self) -> float:
        """Return them."""
        elapsed = monotonic() - self._began
        return elapsed - min(elapsed, max(0.0, self._in_queue() - self._queued))

    def _in_queue(self) -> float:
        """Return the total time that all threads of the processes, ended ones too, have waited for a processor, s."""
        for tasks in self._tasks:
            self._known |= _queued(tasks)
        return sum(self._known.values()) * 1e-9


def _tasks_of(pid: int) -> Path:
    return Path(f"/proc/{pid}/task")


def _queued(tasks: Path) -> dict[Path, int]:
    """Return the time that each thread of a process has waited for a processor, nanoseconds."""
    queued: dict[Path, int] = {}
    try:
        for task in list(tasks.iterdir()):
            queued[task] = int((task / "schedstat").read_text(encoding="ascii").split()[1])
    except (OSError, ValueError, IndexError):
        return queued  # it ended meanwhile, or this system does not tell
    return queued


def see_off(pid: int, status: Callable[[], int | None], seconds: float = FAREWELL) -> str:
    """Wait for the end of a process that is no longer needed; return what was wrong with it, "" if nothing was."""
    waited = Waited(pid)
    while status() is None:
        if waited.seconds() > seconds:
            return f"the process was still there after {seconds:g} s"
        sleep(LOOK)
    return ""


def ended(status: int) -> str:
    """Return in words how a process ended."""
    if status >= 0:
        return f"ended with status {status}"
    try:
        return f"was ended by {signal.Signals(-status).name}"
    except ValueError:
        return f"was ended by signal {-status}"
