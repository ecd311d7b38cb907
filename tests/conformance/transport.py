"""What every transport must do. Subclass `TransportConformance`, say how to make one and how to be its peer:

class TestMine(TransportConformance):
    def make(self): return Mine()
    def connect(self, transport, car): return MinePeer(transport, car)

A peer has `problem()` (waits for the announcement), `frame()` (waits for the next frame and returns its tick, or None
when the trial is over), `send(speed, yaw_rate, tick)`, `hang_up()` and `again()`, which wait until it is seen, and
for `UntypedConformance` also `garbage()`.
"""

from __future__ import annotations

import math
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import dubins_traffic as dt
from dubins_traffic.protocols import Transport
from dubins_traffic.record.sink import End
from dubins_traffic.record.wall import read
from dubins_traffic.runs.single import Result, run_trial
from dubins_traffic.sessions.remote import Session, hand_over, run_remote
from dubins_traffic.transports.clocks import Lockstep, Patience, RealTime
from dubins_traffic.transports.link import Link
from tests.recordings import make_instance

BRIEF = Patience(begin=600.0, silence=3.0, absence=3.0, flood=1000, settle=0.3)
PATIENT = 600.0
"""Seconds for an answer that comes."""
SOON = 10.0
"""Seconds for one that does not: the answers before it must come within that, on a busy machine."""


class Played:
    """A controller that drives a fixed slalom."""

    def start(self, problem: dt.Problem) -> None:
        self.problem = problem

    def act(self, observation: dt.Observation) -> tuple[float, float]:
        return slalom(observation.tick)


def slalom(tick: int) -> tuple[float, float]:
    return 0.3 + 0.1 * math.sin(0.1 * tick), 0.4 * math.cos(0.07 * tick)


class TransportConformance:
    """The suite; `tick_tolerance` seconds is what a frame may be late in real time on a busy machine."""

    ticks = 60
    detects_loss = True
    tagged = True
    """Whether commands carry their tick; where they don't, a flood in lockstep is a trial that is soon over."""
    patience = BRIEF

    def make(self) -> Transport:
        """Return a new transport, not yet open."""
        raise NotImplementedError

    def connect(self, transport: Any, car: str) -> Any:
        """Return a peer that drives `car`."""
        raise NotImplementedError

    @contextmanager
    def link(self, clock: Any, *, ego: bool = True) -> Iterator[Link]:
        link = Link(self.make(), clock, ego=ego, patience=self.patience)
        try:
            yield link
        finally:
            link.close()
        assert not [thread for thread in threading.enumerate() if thread.name == link.transport.name]

    def run(
        self, behave: Callable[[Any], object], clock: Any = None, record: Path | None = None, car: str = "ego"
    ) -> Result:
        """Run one trial in which the peer of `car` behaves so, and verify its record."""
        with tempfile.TemporaryDirectory() as folder:
            path = record or Path(folder) / "a.mcap"
            result = self._run(behave, clock, path, car)
            found = dt.verify(path)
            assert found.verified, found
        return result

    def _run(self, behave: Callable[[Any], object], clock: Any, record: Path, car: str) -> Result:
        instance = make_instance(names=("agent0",), ticks=self.ticks)
        with self.link(clock or Lockstep(PATIENT), ego=car == "ego") as link, ThreadPoolExecutor(1) as pool:
            peer = self.connect(link.transport, car)
            if car != "ego":
                instance = hand_over(instance, [car])
            future = pool.submit(behave, peer)
            result = run_trial(instance, Played(), record=record, link=link)
            future.result(timeout=600)
            peer.hang_up()
        return result

    def test_lockstep_gives_the_frames_of_a_controller_in_process(self, tmp_path: Path) -> None:
        here, there = tmp_path / "here.mcap", tmp_path / "there.mcap"
        result = self.run(answer(), record=there)
        run_trial(make_instance(names=("agent0",), ticks=self.ticks), Played(), record=here)
        assert result.ending.end is End.DURATION
        assert frames(there) == frames(here)
        wall = read(there)
        assert wall is not None
        assert wall.reproducible
        assert wall.transport["drivers"]["ego"]["late"] == 0
        assert wall.time_to_begin_s is not None

    def test_a_remote_e_agent_in_lockstep(self) -> None:
        result = self.run(answer(), car="agent0")
        assert result.ending.end is End.DURATION
        assert result.wall.transport["drivers"]["agent0"]["answer_s"]["count"] == self.ticks

    def test_real_time_takes_its_time_and_records_lateness(self) -> None:
        began = time.monotonic()
        self.patience = replace(self.patience, silence=PATIENT)
        result = self.run(answer(skip=lambda tick: tick % 5 == 2), RealTime(2.0))
        assert result.ending.end is End.DURATION
        assert time.monotonic() - began >= self.ticks / 30 / 2.0
        assert not result.wall.reproducible
        late = result.wall.transport["drivers"]["ego"]["late"]
        assert self.ticks // 5 <= late < self.ticks

    @pytest.mark.parametrize("clock", [Lockstep(SOON), RealTime(2.0)], ids=["lockstep", "real time"])
    def test_a_silent_peer(self, clock: Any) -> None:
        self.ticks = 1200
        result = self.run(answer(until=5), clock)
        assert result.ending.end is (End.DEADLINE if clock.lockstep else End.PEER_SILENT)
        assert result.ending.ticks >= 5

    @pytest.mark.parametrize("hangs_up", [False, True], ids=["silent", "gone"])
    def test_a_peer_that_goes_just_before_the_planned_end(self, hangs_up: bool) -> None:
        """What is left of the trial is shorter than the patience with a silent peer.

        And longer than the pauses that its peer may have made on a busy machine.
        """
        self.ticks = 190
        then = (lambda peer: peer.hang_up()) if hangs_up else None
        result = self.run(answer(until=40, then=then), RealTime(2.0))
        gone = hangs_up and self.detects_loss
        assert result.ending.end is (End.PEER_LOST if gone else End.PEER_SILENT)
        assert result.ending.ticks < self.ticks

    def test_an_e_agent_that_goes_just_before_the_planned_end(self) -> None:
        self.ticks = 190
        result = self.run(answer(until=40), RealTime(2.0), car="agent0")
        assert result.ending.end is End.AGENT_FAULT
        assert result.ending.detail.startswith("agent0: peer_silent")

    def test_a_peer_that_is_late_at_the_planned_end(self) -> None:
        def behave(peer: Any) -> None:
            answer(until=50)(peer)
            time.sleep(1.5)  # the planned end passes meanwhile
            while (tick := peer.frame()) is not None:
                peer.send(*slalom(tick), tick)

        self.patience = replace(self.patience, silence=PATIENT)
        result = self.run(behave, RealTime(2.0))
        assert result.ending.end is End.DURATION

    def test_a_peer_that_seldom_answers_is_not_waited_for_at_the_planned_end(self) -> None:
        """It answers in its usual time, or would: the last frames of the trial are not among those it answers."""
        self.patience = replace(self.patience, silence=PATIENT)
        result = self.run(answer(skip=lambda tick: tick % 20 != 0), RealTime(2.0))
        assert result.ending.end is End.DURATION

    def test_a_peer_that_never_speaks(self) -> None:
        with self.link(Lockstep(SOON)) as link:
            link._patience = replace(self.patience, begin=0.3)
            result = run_trial(make_instance(ticks=30), link=link)
        assert result.ending.end is End.PEER_SILENT
        assert "announcement" in result.ending.detail

    def test_a_peer_that_dies(self) -> None:
        deadline = PATIENT if self.detects_loss else SOON
        result = self.run(answer(until=5, then=lambda peer: peer.hang_up()), Lockstep(deadline))
        assert result.ending.end is (End.PEER_LOST if self.detects_loss else End.DEADLINE)

    def test_a_peer_that_reconnects(self) -> None:
        def behave(peer: Any) -> None:
            answer(until=20, then=lambda peer: peer.hang_up())(peer)
            peer.again()
            answer()(peer)

        self.patience = replace(self.patience, absence=PATIENT)
        result = self.run(behave)
        assert result.ending.end is End.DURATION
        if self.detects_loss:
            assert result.wall.transport["drivers"]["ego"]["reconnections"] == 1

    @pytest.mark.parametrize("bad", [math.nan, math.inf])
    def test_numbers_that_are_not_finite(self, bad: float) -> None:
        result = self.run(answer(until=3, then=lambda peer: peer.send(bad, 0.0, 4)))
        assert result.ending.end is End.CONTROLLER_FAULT
        assert "finite" in result.ending.detail

    def test_a_flood(self) -> None:
        def flood(peer: Any) -> None:
            for k in range(20_000):
                try:
                    peer.send(0.1, 0.0, 3)
                except OSError:
                    return
                if k % 10 == 0:
                    time.sleep(0.001)  # ten kilohertz

        self.patience = replace(self.patience, flood=100)
        clock = Lockstep(SOON) if self.tagged else RealTime(0.5)
        result = self.run(answer(until=3, then=flood), clock)
        assert result.ending.end is End.PEER_FLOOD

    def test_the_fault_of_an_e_agent_names_it(self) -> None:
        result = self.run(answer(until=3), Lockstep(SOON), car="agent0")
        assert result.ending.end is End.AGENT_FAULT
        assert result.ending.detail.startswith("agent0: deadline")

    def test_the_next_trial_goes_on(self) -> None:
        instances = [replace(make_instance(names=(), ticks=30), trial=k) for k in range(3)]

        def drive(peer: Any) -> None:
            answer(until=4)(peer)
            while peer.frame() is not None:
                pass
            for _ in range(2):
                answer()(peer)

        with self.link(Lockstep(SOON)) as link, ThreadPoolExecutor(1) as pool:
            peer = self.connect(link.transport, "ego")
            future = pool.submit(drive, peer)
            ends = [result.ending.end for result in run_remote(Session(link, instances.__getitem__, 3))]
            future.result(timeout=600)
            peer.hang_up()
        assert ends == [End.DEADLINE, End.DURATION, End.DURATION], ends


def answer(
    until: int | None = None,
    then: Callable[[Any], object] | None = None,
    skip: Callable[[int], bool] = lambda _tick: False,
) -> Callable[[Any], None]:
    """Return a behaviour: answer every frame with the slalom, up to a tick; then do something else."""

    def behave(peer: Any) -> None:
        peer.problem()
        while (tick := peer.frame()) is not None:
            if until is not None and tick > until:
                break
            if not skip(tick):
                peer.send(*slalom(tick), tick)
        else:
            return
        if then is not None:
            then(peer)

    return behave


def frames(path: Path) -> bytes:
    """Return the bytes of all frames of a record."""
    block = dt.load_record(path).frames
    columns = (block.x, block.y, block.c, block.s, block.speed, block.yaw_rate)
    return b"".join(column.tobytes() for column in columns)


class UntypedConformance(TransportConformance):
    """The suite for a middleware that lets messages of any type pass."""

    def test_garbage(self) -> None:
        result = self.run(answer(until=3, then=lambda peer: peer.garbage()), Lockstep(SOON))
        assert result.ending.end in (End.PEER_GARBAGE, End.DEADLINE, End.PEER_LOST)
