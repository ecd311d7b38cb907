"""Ctrl-C is heard between frames: every sink has every frame, and the record is one that can be verified."""

import os
import random
import signal
import sys
import threading
from contextlib import suppress
from pathlib import Path
from types import FrameType

import pytest

import dubins_traffic as dt
from dubins_traffic.engine.batch import outcomes
from dubins_traffic.protocols import End, Ending
from dubins_traffic.runs.single import run_trial
from dubins_traffic.trial.interrupts import WHOLE, heard_between_frames
from tests.recordings import make_instance

INSTANCE = make_instance(ticks=150)


class Counting:
    """A sink that counts frames; at the second block the process is interrupted while it is in there."""

    def __init__(self, *, interrupts: bool) -> None:
        self.interrupts, self.count, self.ending = interrupts, 0, None

    def begin(self, instance: dt.Instance) -> None:
        self.instance = instance

    def frames(self, frames: dt.Frames) -> None:
        if self.interrupts and frames.first == 30:
            signal.raise_signal(signal.SIGINT)
        self.count += len(frames)

    def end(self, ending: Ending) -> None:
        self.ending = ending


def test_an_interrupt_in_a_sink_leaves_no_sink_without_the_frame(tmp_path: Path) -> None:
    sinks = [Counting(interrupts=True), Counting(interrupts=False)]
    with pytest.raises(KeyboardInterrupt):
        run_trial(INSTANCE, "simple", record=tmp_path / "a.mcap", sinks=sinks)
    assert [sink.count for sink in sinks] == [60, 60]
    assert [sink.ending for sink in sinks] == [Ending(End.INTERRUPTED, 59)] * 2
    assert len(dt.load_record(tmp_path / "a.mcap").frames) == 60
    found = dt.verify(tmp_path / "a.mcap")
    assert found.verified, found
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_interrupts_at_any_instant_leave_records_that_are_verified(tmp_path: Path) -> None:
    for k in range(12):
        path = tmp_path / f"{k}.mcap"
        timer = threading.Timer(0.002 * k, lambda: os.kill(os.getpid(), signal.SIGINT))
        with pytest.raises(KeyboardInterrupt):
            _run_on_and_on(path, timer)
        found = dt.verify(path)
        assert found.verified, found
        assert found.end == "interrupted"


def _run_on_and_on(path: Path, timer: threading.Timer) -> None:
    class Driving:
        def start(self, problem: dt.Problem) -> None:
            self.problem = problem
            timer.start()

        def act(self, observation: dt.Observation) -> tuple[float, float]:
            return 0.3, 0.1 * (observation.tick % 3)

    run_trial(make_instance(ticks=3_000_000), Driving(), record=path)


def test_what_came_is_heard_at_the_end_and_elsewhere_at_once() -> None:
    told: list[str] = []

    def interrupted() -> None:
        signal.raise_signal(signal.SIGINT)
        told.append("heard late")

    def as_a_whole() -> None:
        with WHOLE:
            interrupted()

    with heard_between_frames():
        with pytest.raises(KeyboardInterrupt):
            as_a_whole()
        assert told == ["heard late"]
        with pytest.raises(KeyboardInterrupt):
            interrupted()
    assert told == ["heard late"]


def test_an_interrupt_at_any_call_is_heard(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also in what NumPy calls by itself: it drops whatever is raised while it describes an array.

    What Python itself drops, in a destructor, it tells its hook; `cli.signals` sees that it comes again.
    """
    dropped: list[object] = []
    monkeypatch.setattr(sys, "unraisablehook", lambda told: dropped.append(told.exc_type))

    def play(last: int | None) -> int:
        """Run trials, interrupted at the call of that number, if any; return how many calls there were."""
        calls = 0

        def count(_frame: FrameType, event: str, _given: object) -> None:
            nonlocal calls
            calls += event == "call"  # at a return, what a function was to give back would stay taken: a lock
            if calls == last:
                sys.setprofile(None)
                signal.raise_signal(signal.SIGINT)

        sys.setprofile(count)
        try:
            list(outcomes([INSTANCE] * 2, "simple", batch=2))
        finally:
            sys.setprofile(None)
        return calls

    play(None)
    for last in random.Random(1).sample(range(1, play(None) - 20), 80):
        dropped.clear()
        with suppress(KeyboardInterrupt):
            play(last)
            assert dropped == [KeyboardInterrupt], last
