"""A peer for transports whose messages carry no tick: it numbers frames by their stamps, in simulated time."""

from __future__ import annotations

import time
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from math import floor
from typing import Any

from dubins_traffic.protocols import End, Ending
from dubins_traffic.transports.clocks import Lockstep
from tests.conformance.transport import PATIENT, TransportConformance
from tests.recordings import make_instance

RATE = 30.0
Odometry = tuple[float, float, float]
"""Stamp, x and y."""


class RosPeer:
    """Takes the ego's odometry and the problem, one message for each; a subclass carries them.

    A subclass has `open`, `shut`, `heard` (whether its commands have a reader), `put` (sends a command) and `fetch`
    (returns what comes next: the text of a problem, an odometry, or None after a while).
    """

    def __init__(self, transport: Any, car: str) -> None:
        self.transport, self.car = transport, car
        self.begun = self.there = False
        self.answered = -1
        self.again()

    def again(self) -> None:
        """Come, or come again: what was seen last has not been answered."""
        self.answered -= 1
        self.open()
        self.there = True

    def hang_up(self) -> None:
        if self.there:
            self.there = False
            self.shut()
            self.await_seen(False)

    def await_seen(self, there: bool) -> None:
        """Wait until the session knows that this peer is there, or gone."""
        until = time.monotonic() + PATIENT
        while True:
            self.transport.look()
            if bool(self.transport._there.get(self.car)) is there:
                return
            assert time.monotonic() < until
            time.sleep(0.01)

    def problem(self) -> None:
        """Wait for the announcement, and until this peer is seen to be there."""
        while not self.begun:
            came = self.next()
            self.begun = isinstance(came, str) and came != ""
            self.start: tuple[float, float] | None = None
            self.answered = -1
        until = time.monotonic() + PATIENT
        while not self.heard():
            assert time.monotonic() < until
            time.sleep(0.01)
        self.await_seen(True)

    def frame(self) -> int | None:
        """Return the number of the next frame that has none of an earlier message, None when the trial is over."""
        while True:
            came = self.next()
            if came == "":
                self.begun = False
                return None
            if not isinstance(came, str) and (tick := self.number(*came)) > self.answered:
                self.answered = tick
                return tick

    def number(self, stamp: float, x: float, y: float) -> int:
        """Frame 0 is shown until it is answered, and the ego moves in every tick after."""
        self.start = self.start or (x, y)
        if (x, y) == self.start:
            self.zero = stamp
        return floor((stamp - self.zero) * RATE + 1e-3)

    def send(self, speed: float, yaw_rate: float, tick: int) -> None:  # noqa: ARG002  # the messages carry none
        self.put(speed, yaw_rate)

    def next(self) -> str | Odometry:
        until = time.monotonic() + PATIENT
        while (came := self.fetch()) is None:
            assert time.monotonic() < until, "nothing comes"
        return came

    def open(self) -> None:
        raise NotImplementedError

    def shut(self) -> None:
        raise NotImplementedError

    def heard(self) -> bool:
        raise NotImplementedError

    def slow_to_hear(self) -> AbstractContextManager[None]:
        """Keep problems from this peer for a while."""
        return nullcontext()

    def put(self, speed: float, yaw_rate: float) -> None:
        raise NotImplementedError

    def fetch(self) -> str | Odometry | None:
        raise NotImplementedError


class RosConformance(TransportConformance):
    """The suite for transports whose peers are told of the ends of trials by an empty problem."""

    tagged = False

    def test_who_is_slow_is_told_of_each_end_though_the_next_trial_begins_at_once(self) -> None:
        """A peer that missed an end would take the frames of the next trial for those of the one before."""
        instance = make_instance(names=(), ticks=30)
        last = replace(instance, problem=replace(instance.problem, intersection_radius=0.75))
        with self.link(Lockstep(PATIENT), ego=False) as link:
            transport: Any = link.transport
            transport.begin(instance, ["ego"])
            peer = self.connect(transport, "ego")
            while peer.fetch() is None:
                transport.announce(instance)
            with peer.slow_to_hear():
                for _ in range(4):
                    transport.announce(instance)
                    transport.end(Ending(End.DURATION, 30))
                transport.announce(last)
            ends = 0
            while "0.75" not in str(came := peer.next()):
                ends += came == ""
            peer.hang_up()
        assert ends == 4
