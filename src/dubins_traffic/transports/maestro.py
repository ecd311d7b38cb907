"""The modes of 2016: who may start a trial, and when (docs/design/040-transports.md)."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum, IntEnum
from threading import Lock


class Mode(IntEnum):
    """What a client may ask the maestro for, with the numbers of 2016."""

    RESET = 0
    RESTART = 1
    READY = 4
    START = 5


class Phase(Enum):
    """Where the session stands."""

    PREPARING = "preparing"
    READY = "ready"
    RUNNING = "running"


class Next(Enum):
    """What comes after the present instance."""

    RUN = "run it"
    DRAW = "draw a new one"
    REPEAT = "run it again"


class Maestro:
    """Answers mode requests from any thread.

    READY is granted once an instance is up, START only then; RESET ends a running trial, which counts, or passes over
    the instance that is up; RESTART runs the same instance again.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._phase = Phase.PREPARING
        self._next: Next | None = None
        self.interrupt: Callable[[str], None] = lambda _detail: None
        """Called, with a word of detail, to end the trial that is running; and with "" when there is news."""

    @property
    def next(self) -> Next | None:
        """What has been asked for since the instance was put up."""
        return self._next

    @property
    def phase(self) -> Phase:
        """Where the session stands."""
        return self._phase

    def enter(self, phase: Phase) -> None:
        """Say where the session stands now."""
        with self._lock:
            if phase is not Phase.RUNNING:
                self._next = None
            self._phase = phase

    def request(self, mode: int) -> bool:
        """Return whether what a client asks for is granted; unknown modes are not."""
        with self._lock:
            ready, running = self._phase is Phase.READY and self._next is None, self._phase is Phase.RUNNING
            match mode:
                case Mode.READY:
                    return ready
                case Mode.START if ready:
                    self._next, detail = Next.RUN, ""
                case Mode.RESET if ready:
                    self._next, detail = Next.DRAW, ""
                case Mode.RESET if running:
                    self._next, detail = Next.DRAW, "reset asked for"
                case Mode.RESTART if running:
                    self._next, detail = Next.REPEAT, "restart asked for"
                case Mode.RESTART:
                    return ready
                case _:
                    return False
        self.interrupt(detail)
        return True
