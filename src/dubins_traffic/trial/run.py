"""Runs a controller through a trial: prepare (timed), run, end."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Generator, Iterable, Sequence
from time import perf_counter
from types import FrameType
from typing import Final, cast

from dubins_traffic.controllers import blame
from dubins_traffic.errors import ControllerError, PeerError, shown
from dubins_traffic.protocols import Closes, Controller, End, Ending, Reports
from dubins_traffic.record.wall import Wall, measured, summary
from dubins_traffic.trial.interrupts import heard_between_frames
from dubins_traffic.trial.trial import Trial

CLOSE_RAISED: Final = "close raised"
"""In the detail of an ending, before what a controller's `close` raised."""


class _TooLateError(Exception):
    def __init__(self, deadline: float) -> None:
        self.deadline = deadline
        super().__init__(deadline)


def run(trial: Trial, controller: Controller, deadline: float | None = None) -> tuple[Ending, Wall]:
    """Run `controller` through `trial` until it ends and return its ending and wall-clock figures.

    A controller that raises, gives up (None), answers nonsense, or takes longer than `deadline` seconds for one
    `act` ends its own trial with a named reason; nothing is raised but what interrupts the program.
    """
    latencies: list[float] = []
    begin: float | None = None
    with heard_between_frames():
        try:
            started = perf_counter()
            with _Answerable(trial):
                controller.start(trial.instance.problem)
            begin = perf_counter() - started
            _drive(trial, controller, deadline, latencies)
        except (KeyboardInterrupt, SystemExit):
            trial.end(End.INTERRUPTED)
            raise
        except ControllerError as error:
            trial.end(End(error.reason), error.detail)
    ending = close(controller, trial.end(End.DURATION))
    return ending, measured(begin, summary(latencies), reproducible=ending.end is not End.DEADLINE)


def _drive(trial: Trial, controller: Controller, deadline: float | None, latencies: list[float]) -> None:
    act = controller.act
    advance = trial.advance
    report = controller.report if isinstance(controller, Reports) else None
    while trial.ending is None:
        observation = trial.observation
        with _Answerable(trial):
            started = perf_counter()
            if deadline is None:
                command = act(observation)
            else:
                with _alarm(deadline):
                    command = act(observation)
            elapsed = perf_counter() - started
        latencies.append(elapsed)
        if report is not None:
            with _Answerable(trial):
                for kind, detail in told(report()):
                    trial.note(kind, detail)
        if deadline is not None and elapsed > deadline:
            raise _late(trial, deadline)
        if command is None:
            trial.end(End.GAVE_UP, f"the controller gave up at tick {trial.tick}")
        else:
            advance(command)


class _Answerable:
    """Whatever the controller raises in the body is its fault, and becomes the named end of its trial.

    That includes SystemExit: a controller ends its trial, not the program. Only Ctrl-C goes through, and a PeerError
    names the end by itself.
    """

    __slots__ = ("_trial",)

    def __init__(self, trial: Trial) -> None:
        self._trial = trial

    def __enter__(self) -> None:
        pass

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _traceback: object
    ) -> None:
        if isinstance(error, _TooLateError):
            raise _late(self._trial, error.deadline) from None
        if error is not None and not isinstance(error, KeyboardInterrupt | PeerError):
            blame.show(error)
            detail = blame.told(error, self._trial.tick)
            raise ControllerError(End.CONTROLLER_FAULT.value, detail) from error


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


def _late(trial: Trial, deadline: float) -> ControllerError:
    return ControllerError(End.DEADLINE.value, f"act took more than {deadline} s at tick {trial.tick}")


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


def close(controller: Controller, ending: Ending) -> Ending:
    """Tell a controller that its trial is over; return the ending, with what closing raised in its detail."""
    if isinstance(controller, Closes):
        try:
            controller.close()
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # the trial is over and judged; its detail says what closing did
            blame.show(error)
            detail = f"{ending.detail}; {CLOSE_RAISED} {blame.told(error)}".lstrip("; ")
            return Ending(ending.end, ending.ticks, detail)
    return ending
