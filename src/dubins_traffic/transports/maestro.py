"""Maestros: ours, with the modes of 2016 (docs/design/040-transports.md), and one that is not ours."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import contextmanager
from enum import Enum, IntEnum
from threading import Condition, Lock
from time import monotonic

from dubins_traffic.errors import TransportError


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
    the instance that is up; RESTART runs the same instance again. What is asked between two instances is answered when
    the next one is up: programs of 2016 ask START once, and take any answer to READY for yes.
    """

    def __init__(self) -> None:
        self._news = Condition()
        self._phase = Phase.PREPARING
        self._next: Next | None = None
        self._closed = False
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
        """Say where the session stands now; who waits for an answer may get it."""
        with self._news:
            if phase is Phase.READY:
                self._next = None
            self._phase, self._closed = phase, False
            self._news.notify_all()

    def close(self) -> None:
        """The session is over: who waits for an answer, or asks from now on, is refused."""
        with self._news:
            self._closed = True
            self._news.notify_all()

    def request(self, mode: int) -> bool:
        """Return whether what a client asks for is granted; wait until that can be said, or the session is over."""
        while True:
            with self._news:
                granted, detail = self._decide(mode)
                if granted is None:
                    self._news.wait()
                    continue
            return self._tell(granted, detail)

    def answer(self, mode: int) -> bool | None:
        """Do as `request`, but return None at once if it can't be said yet: ask again later."""
        with self._news:
            granted, detail = self._decide(mode)
        return None if granted is None else self._tell(granted, detail)

    def _tell(self, granted: bool, detail: str | None) -> bool:
        if detail is not None:
            self.interrupt(detail)
        return granted

    def _decide(self, mode: int) -> tuple[bool | None, str | None]:
        """Return the answer, None for "not yet", and what the session is told, None for nothing."""
        if self._closed or mode not in set(Mode):
            return False, None
        match self._phase, self._next:
            case Phase.READY, None:
                return self._decide_ready(mode)
            case Phase.RUNNING, _:
                return self._decide_running(mode)
            case Phase.READY, Next.RUN if mode in (Mode.READY, Mode.START):
                return False, None
            case _:
                return None, None

    def _decide_ready(self, mode: int) -> tuple[bool, str | None]:
        if mode in (Mode.READY, Mode.RESTART):
            return True, None
        self._next = Next.RUN if mode == Mode.START else Next.DRAW
        return True, ""

    def _decide_running(self, mode: int) -> tuple[bool | None, str | None]:
        """RESET and RESTART end the trial; from then on the others wait for the next instance."""
        if mode == Mode.RESET:
            self._next = Next.DRAW
            return True, "reset asked for"
        if mode == Mode.RESTART:
            self._next = Next.REPEAT
            return True, "restart asked for"
        return (None if self._next in (Next.DRAW, Next.REPEAT) else False), None


class ForeignMaestro:
    """What another maestro tells, from any thread: problems, and the ends of trials.

    A problem is told once and taken once; an empty text ends the trial that runs, and takes back a problem that nobody
    has taken.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._told: str | None = None
        self._text = ""
        self._over = True
        self._began = self._ended = monotonic()
        self.news: Callable[[], None] = lambda: None
        """Called when a problem has been told, or a trial is over."""

    def tell(self, text: str) -> None:
        """Take what the maestro has published; what it publishes twice counts once."""
        with self._lock:
            if text == self._text:
                return
            self._text = text
            self._told, self._over = (text, False) if text else (None, True)
            if text:
                self._began = monotonic()
            else:
                self._ended = monotonic()
        self.news()

    @property
    def asks(self) -> bool:
        """Whether there is a problem that nobody has taken."""
        return self._told is not None

    @property
    def over(self) -> bool:
        """Whether no trial runs, for the maestro."""
        return self._over

    @property
    def lasted(self) -> float:
        """Seconds of the wall since the latest problem was told, until the end was, if it was."""
        return (self._ended if self._over else monotonic()) - self._began

    def take(self) -> str | None:
        """Return the problem that has been told, once."""
        with self._lock:
            problem, self._told = self._told, None
        return problem


@contextmanager
def closing_if_refused(close: Callable[[], None]) -> Generator[None]:
    """Call `close` if the body raises TransportError, which goes on."""
    try:
        yield
    except TransportError:
        close()
        raise
