"""Calls a controller's methods in order, measures them, and turns what goes wrong into a named end of its trial."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Callable, Generator, Iterable, Sequence
from time import perf_counter
from types import FrameType
from typing import TYPE_CHECKING, Final, cast

from dubins_traffic.controllers import blame
from dubins_traffic.errors import ControllerError, PeerError, shown
from dubins_traffic.protocols import Closes, Controller, End, Ending, Reports
from dubins_traffic.record.sink import BY_CONTROLLER

if TYPE_CHECKING:
    from dubins_traffic.cars.state import Observation
    from dubins_traffic.problem.instance import Problem

CLOSE_RAISED: Final = "close raised"
"""In the detail of an ending, before what a controller's `close` raised."""
_PEERS_OWN: Final = BY_CONTROLLER | {End.BOX_FAILED}
"""Ends that a PeerError may name in a trial that nobody elsewhere takes part in."""


class _TooLateError(Exception):
    def __init__(self, deadline: float) -> None:
        self.deadline = deadline
        super().__init__(deadline)


class Seat:
    """Calls the ego's controller through one trial: a single one, one of a batch, or one of a session.

    The seat starts the controller, asks it once a tick, collects its reports, and closes it. Whatever the
    controller raises, answers or reports wrongly is its fault and becomes a ControllerError that names the end of its
    trial. Beside that only KeyboardInterrupt and PeerError (which names the end itself) pass through. A process that
    the controller has forked ends where it would go on as the judge.

    Parameters
    ----------
    controller : Controller
        Drives the ego.
    deadline : float, optional
        Seconds within which each `act` must answer; by default it may take its time.
    linked : bool
        Whether somebody elsewhere takes part in the trial, who may end it as he likes.

    Attributes
    ----------
    begin : float or None
        Wall-clock seconds of the controller's `start`, None if it did not return.
    latencies : list of float
        Wall-clock seconds of each call of its `act`.
    """

    def __init__(self, controller: Controller, deadline: float | None = None, *, linked: bool = False) -> None:
        self.begin: float | None = None
        self.latencies: list[float] = []
        self._controller = controller
        self._reports = isinstance(controller, Reports)
        self._deadline = deadline
        self._guard = Answerable(linked=linked)

    def start(self, problem: Problem, tick: int = 0) -> None:
        """Hand the problem to the controller, in frame `tick`, and measure how long it takes.

        Raises
        ------
        ControllerError
            If the controller raises anything.
        """
        started = perf_counter()
        self._guard.tick = tick
        with self._guard:
            self._controller.start(problem)
        self.begin = perf_counter() - started

    def act(self, seen: Observation, note: Callable[[str, str], object]) -> tuple[float, float]:
        """Return the controller's command, still unchecked, and pass its reports to ``note(kind, detail)``.

        Raises
        ------
        ControllerError
            If the controller raises, reports nonsense, gives up, or takes longer than its deadline.
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
                for kind, detail in checked_reports(cast(Reports, controller).report()):
                    note(kind, detail)
        if deadline is not None and elapsed > deadline:
            raise _deadline_error(deadline, seen.tick)
        if command is None:
            raise ControllerError(End.GAVE_UP.value, f"the controller gave up at tick {seen.tick}")
        return command

    def end(self, ending: Ending) -> Ending:
        """Close the controller; return the ending, to whose detail an error of `close` is added."""
        if isinstance(self._controller, Closes):
            try:
                self._controller.close()
            except KeyboardInterrupt:
                raise
            except BaseException as error:  # the trial is over and judged; its detail says what closing did
                blame.show(error)
                detail = f"{ending.detail}; {CLOSE_RAISED} {blame.error_text(error)}".lstrip("; ")
                return Ending(ending.end, ending.ticks, detail)
            finally:
                self._guard.end_forked()
        return ending


class Answerable:
    """A `with` block around calls of a controller in frame `tick`: what it raises becomes a ControllerError.

    That includes SystemExit: a controller ends its trial, not the program. A PeerError goes through if it names an end
    that a peer can bring about; that the whole duration is over is for the trial to say, or for others (`linked`).
    """

    __slots__ = ("_linked", "_process", "tick")

    def __init__(self, *, linked: bool = False) -> None:
        self.tick = 0
        self._linked = linked
        self._process = os.getpid()

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _traceback: object) -> None:
        self.end_forked()
        if isinstance(error, _TooLateError):
            raise _deadline_error(error.deadline, self.tick) from None
        if error is None or isinstance(error, KeyboardInterrupt) or self._names_end(error):
            return
        blame.show(error)
        raise fault(error, self.tick) from error

    def end_forked(self) -> None:
        """End this process if it is one that the controller has forked: there is one judge."""
        if os.getpid() != self._process:
            os._exit(0)

    def _names_end(self, error: BaseException) -> bool:
        """Whether an error names an end of the trial by itself."""
        if not isinstance(error, PeerError):
            return False
        ends = tuple(End) if self._linked else tuple(_PEERS_OWN)
        return isinstance(cast(object, error.detail), str) and error.reason in ends


def fault(error: BaseException, tick: int) -> ControllerError:
    """Return the ControllerError for an `error` that a controller has raised in frame `tick`."""
    return ControllerError(End.CONTROLLER_FAULT.value, blame.error_text(error, tick))


def checked_reports(reports: Iterable[object]) -> list[tuple[str, str]]:
    """Return the reports of a controller as pairs (kind, detail) of printable one-line texts, as records hold them.

    Raises
    ------
    TypeError
        If a report is anything but a pair of texts.
    """
    checked: list[tuple[str, str]] = []
    for entry in reports:
        pair = tuple(cast("Sequence[object]", entry)) if isinstance(entry, tuple | list) else ()
        if len(pair) != 2 or not all(isinstance(part, str) for part in pair):
            raise TypeError(
                f"report() must return pairs of texts (kind, detail): got {blame.value_text(cast(object, entry), 80)}"
            )
        kind, detail = map(str, pair)
        checked.append((shown(kind), shown(detail)))
    return checked


def _deadline_error(deadline: float, tick: int) -> ControllerError:
    return ControllerError(End.DEADLINE.value, f"act took more than {deadline} s at tick {tick}")


@contextlib.contextmanager
def _alarm(seconds: float) -> Generator[None]:
    """Raise _TooLateError in the body after `seconds`, where platform and thread allow it; leave other alarms."""
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "setitimer"):
        yield
        return

    def ring(_signal: int, _frame: FrameType | None) -> None:
        raise _TooLateError(seconds)

    before, timer = signal.signal(signal.SIGALRM, ring), signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
        signal.setitimer(signal.ITIMER_REAL, *timer)
