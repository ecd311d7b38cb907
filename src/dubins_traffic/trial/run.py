"""Runs a controller through a trial: prepare (timed), run, end."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from time import perf_counter
from types import FrameType

import numpy as np

from dubins_traffic.errors import ControllerError
from dubins_traffic.protocols import Closes, Controller, End, Ending
from dubins_traffic.record.wall import Wall, measured
from dubins_traffic.trial.trial import Trial


class _TooLateError(Exception):
    pass


def run(trial: Trial, controller: Controller, deadline: float | None = None) -> tuple[Ending, Wall]:
    """Run `controller` through `trial` until it ends and return its ending and wall-clock figures.

    A controller that raises, gives up (None), answers nonsense, or takes longer than `deadline` seconds for one
    `act` ends its own trial with a named reason; nothing is raised but what interrupts the program.
    """
    latencies: list[float] = []
    begin: float | None = None
    try:
        started = perf_counter()
        controller.start(trial.instance.problem)
        begin = perf_counter() - started
        _drive(trial, controller, deadline, latencies)
    except (KeyboardInterrupt, SystemExit):
        trial.end(End.INTERRUPTED)
        raise
    except ControllerError as error:
        trial.end(End(error.reason), error.detail)
    except _TooLateError:
        trial.end(End.DEADLINE, f"act took more than {deadline} s at tick {trial.tick}")
    except Exception as error:  # a controller may raise anything; its trial names it
        trial.end(End.CONTROLLER_FAULT, f"{type(error).__name__}: {error} at tick {trial.tick}")
    ending = trial.end(End.DURATION)
    ending = _close(controller, ending)
    return ending, measured(begin, _summary(latencies), reproducible=ending.end is not End.DEADLINE)


def _drive(trial: Trial, controller: Controller, deadline: float | None, latencies: list[float]) -> None:
    act = controller.act
    advance = trial.advance
    while trial.ending is None:
        observation = trial.observation
        started = perf_counter()
        if deadline is None:
            command = act(observation)
        else:
            with _alarm(deadline):
                command = act(observation)
        elapsed = perf_counter() - started
        latencies.append(elapsed)
        if deadline is not None and elapsed > deadline:
            raise _TooLateError
        if command is None:
            trial.end(End.GAVE_UP, f"the controller gave up at tick {trial.tick}")
        else:
            advance(command)


@contextlib.contextmanager
def _alarm(seconds: float) -> Iterator[None]:
    """Raise _TooLateError in the body after `seconds`, where the platform and thread allow it."""
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "setitimer"):
        yield
        return

    def ring(_signal: int, _frame: FrameType | None) -> None:
        raise _TooLateError

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def _close(controller: Controller, ending: Ending) -> Ending:
    if isinstance(controller, Closes):
        try:
            controller.close()
        except Exception as error:  # the trial is over and judged; its detail says what closing did
            detail = f"{ending.detail}; close raised {type(error).__name__}: {error}".lstrip("; ")
            return Ending(ending.end, ending.ticks, detail)
    return ending


def _summary(latencies: list[float]) -> dict[str, float]:
    if not latencies:
        return {}
    values = np.array(latencies)
    return {
        "count": float(len(latencies)),
        "mean": float(values.mean()),
        "median": float(np.median(values)),
        "p99": float(np.percentile(values, 99)),
        "max": float(values.max()),
    }
