"""A controller in its place: what it is asked, in which order, and whose fault it is when that goes wrong."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Generator, Iterable, Sequence
from time import perf_counter
from types import FrameType
from typing import TYPE_CHECKING, Final, cast

from dubins_traffic.controllers import blame
from dubins_traffic.errors import ControllerError, PeerError, shown
from dubins_traffic.protocols import Closes, Controller, End, Ending, Reports

if TYPE_CHECKING:
    from dubins_traffic.cars.state import Observation
    from dubins_traffic.problem.instance import Problem

CLOSE_RAISED: Final = "close raised"
"""In the detail of an ending, before what a controller's `close` raised."""


class _TooLateError(Exception):
    def __init__(self, deadline: float) -> None:
        self.deadline = deadline
        super().__init__(deadline)


class Seat:
    """The ego's controller in one trial, run by itself, in a batch or in a session.

    It is started, asked once a tick, heard if it reports, and told the end. Whatever it raises, answers or reports
    wrongly is its fault and becomes a ControllerError that names the end of its trial; nothing else gets out but
    KeyboardInterrupt, and a PeerError, which names the end by itself.

    Parameters
    ----------
    controller : Controller
        Who drives.
    deadline : float, optional
        Seconds within which each `act` must answer; by default it may take its time.

    Attributes
    ----------
    begin : float or None
        Wall-clock seconds of the controller's `start`, None if it did not return.
    latencies : list of float
        Wall-clock seconds of each call of its `act`.
    """

    def __init__(self, controller: Controller, deadline: float | None = None) -> None:
        self.begin: float | None = None
        self.latencies: list[float] = []
        self._controller = controller
        self._reports = isinstance(controller, Reports)
        self._deadline = deadline
        self._guard = Answerable()

    def start(self, problem: Problem, tick: int = 0) -> None:
        """Tell the controller the problem, in frame `tick`.

        Raises
        ------
        ControllerError
            If that is more than it can take.
        """
        started = perf_counter()
        self._guard.tick = tick
        with self._guard:
            self._controller.start(problem)
        self.begin = perf_counter() - started

    def act(self, seen: Observation, note: Callable[[str, str], object]) -> tuple[float, float]:
        """Return what the controller answers, which nobody has checked yet; `note` is told what it reports.

        Raises
        ------
        ControllerError
            If it is at fault, gives up, or takes longer than it may.
        """
        guard, controller, deadline = self._guard, self._controller, self._deadline
        guard.tick = seen.tick
        with guard:
            started = perf_counter()
            if deadline is None:
                command = controller.act(seen)
            else:
                with _alarm(deadline):
                    command = controller.act(seen)
            elapsed = perf_counter() - started
        self.latencies.append(elapsed)
        if self._reports:
            with guard:
                for kind, detail in told(cast(Reports, controller).report()):
                    note(kind, detail)
        if deadline is not None and elapsed > deadline:
            raise _late(deadline, seen.tick)
        if command is None:
            raise ControllerError(End.GAVE_UP.value, f"the controller gave up at tick {seen.tick}")
        return command

    def end(self, ending: Ending) -> Ending:
        """Tell the controller that its trial is over; return the ending, with what closing raised in its detail."""
        if isinstance(self._controller, Closes):
            try:
                self._controller.close()
            except KeyboardInterrupt:
                raise
            except BaseException as error:  # the trial is over and judged; its detail says what closing did
                blame.show(error)
                detail = f"{ending.detail}; {CLOSE_RAISED} {blame.told(error)}".lstrip("; ")
                return Ending(ending.end, ending.ticks, detail)
        return ending


class Answerable:
    """Whatever a controller raises in the body, in frame `tick`, is its fault, and becomes the named end of its trial.

    That includes SystemExit: a controller ends its trial, not the program.
    """

    __slots__ = ("tick",)

    def __init__(self) -> None:
        self.tick = 0

    def __enter__(self) -> None:
        pass

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _traceback: object
    ) -> None:
        if isinstance(error, _TooLateError):
            raise _late(error.deadline, self.tick) from None
        if error is not None and not isinstance(error, KeyboardInterrupt | PeerError):
            blame.show(error)
            raise fault(error, self.tick) from error


def fault(error: BaseException, tick: int) -> ControllerError:
    """Return the fault that it was of a controller to raise `error` in frame `tick`."""
    return ControllerError(End.CONTROLLER_FAULT.value, blame.told(error, tick))


def told(reports: Iterable[object]) -> list[tuple[str, str]]:
    """Return what a controller reports, pairs of kind and detail, as lines that a record can hold.

    Raises
    ------
    TypeError
        If it is anything else.
    """
    found: list[tuple[str, str]] = []
    for entry in reports:
        pair = tuple(cast("Sequence[object]", entry)) if isinstance(entry, tuple | list) else ()
        if len(pair) != 2 or not all(isinstance(part, str) for part in pair):
            raise TypeError(
                f"a report is pairs of texts (kind, detail): got {blame.said(cast(object, entry), 80)}"
            )
        kind, detail = map(str, pair)
        found.append((shown(kind), shown(detail)))
    return found


def _late(deadline: float, tick: int) -> ControllerError:
    return ControllerError(End.DEADLINE.value, f"act took more than {deadline} s at tick {tick}")


@contextlib.contextmanager
def _alarm(seconds: float) -> Generator[None]:
    """Raise _TooLateError in the body after `seconds`, where the platform and thread allow it."""
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "setitimer"):
        yield
        return

    def ring(_signal: int, _frame: FrameType | None) -> None:
        raise _TooLateError(seconds)

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
