"""The transport `lcm`."""

from __future__ import annotations

import os
import struct
from collections import deque
from collections.abc import Callable, Sequence
from select import select
from time import monotonic, time_ns
from typing import TYPE_CHECKING

from dubins_traffic.errors import TransportError
from dubins_traffic.protocols import End, Ending, Mailbox, View
from dubins_traffic.transports.labels import Caption
from dubins_traffic.transports.lcm import connection, encoding
from dubins_traffic.transports.lcm.dubins_traffic_lcm import command_t, end_t, grant_t, labels_t, mode_t
from dubins_traffic.transports.maestro import Maestro, Mode, closing_if_refused

if TYPE_CHECKING:
    from lcm import LCMSubscription

    from dubins_traffic.problem.instance import Instance

NO_TRIAL = -1
MOST_AT_ONCE = 256
"""Messages after which the trial is looked at again, however many there are."""
MOST_WAITING = 1000
"""Requests that may wait for the next instance; of more, the oldest are never answered."""
ANSWER = 0.5
"""Seconds in which another session at the same URL would answer; it looks at what has come every 0.1 s."""
GARBAGE = (ValueError, struct.error, IndexError)


class Lcm:
    """Typed messages over LCM (a `protocols.Transport`).

    Nobody connects: whoever knows the URL may listen, and drives a car by sending commands that name the trial and
    the tick. LCM does not say who is there, so a peer that dies is one that has become silent.

    Parameters
    ----------
    url : str, optional
        An LCM URL; by default that of the environment variable ``LCM_DEFAULT_URL``, else multicast within this machine.
    maestro : Maestro, optional
        Answers mode requests; without one READY and START are granted whenever they are asked for.
    """

    name = "lcm"
    tagged = True
    again = 0.05

    def __init__(self, url: str | None = None, maestro: Maestro | None = None) -> None:
        self.url = url or connection.usual_url()
        self._maestro = maestro
        self._cars: list[tuple[str, int]] = []
        self._subscriptions: list[LCMSubscription] = []
        self._trial = NO_TRIAL
        self._next = time_ns() // 1_000_000  # so that no program takes a new session's trial for an old one's
        self._announced = b""
        self._waiting: deque[mode_t] = deque(maxlen=MOST_WAITING)
        self._open = False

    def open(self, mailbox: Mailbox) -> None:
        """Join the multicast group; TransportError if that can't be."""
        self._mailbox = mailbox
        self._lcm = connection.connect(self.url)
        self._open = True
        with closing_if_refused(self.close):
            self._look_for_others()
        self._lcm.subscribe(connection.MODE, self._mode_requested)

    def begin(self, instance: Instance, remote: Sequence[str]) -> None:
        """Listen to the drivers of the cars."""
        self._encoder = encoding.Encoder(instance.names)
        self._caption = Caption(instance.problem.network, instance.names)
        self._announced, self._trial = b"", NO_TRIAL
        for subscription in self._subscriptions:
            self._lcm.unsubscribe(subscription)
        self._subscriptions = [self._lcm.subscribe(connection.command(car), self._commanded(car)) for car in remote]
        self._cars = [(connection.state(car), instance.names.index(car)) for car in remote]

    def announce(self, instance: Instance) -> None:
        """Begin a trial; the problem is sent with frame 0."""
        self._trial = self._next
        self._next += 1
        self._announced = encoding.problem_to_message(instance.problem, self._trial).encode()

    def frame(self, view: View) -> None:
        """Send every driver its own observation; then everybody where all cars are."""
        if view.running:
            if view.tick == 0:
                self._publish(connection.INSTANCE, self._announced)
            for channel, n in self._cars:
                self._publish(channel, self._encoder.state(view.observe(n), self._trial, n))
        self._show(view)

    def end(self, ending: Ending) -> None:
        """Say that the trial is over."""
        message = end_t()
        message.trial, message.ticks = self._trial, ending.ticks
        message.reason, message.detail = ending.end.value, ending.detail
        self._announced, self._trial = b"", NO_TRIAL
        self._publish(connection.END, message.encode())

    def close(self) -> None:
        """Leave the multicast group."""
        if not self._open:
            return
        self._open = False
        self._subscriptions = []
        del self._lcm

    def receive(self, seconds: float) -> None:
        """Take what has come, or comes within so long."""
        lcm = self._lcm
        asked, self._waiting = self._waiting, deque(maxlen=MOST_WAITING)
        for one in asked:
            self._grant(one)
        if seconds > 0.0:
            select([lcm.fileno()], [], [], seconds)  # LCM itself waits for whole milliseconds
        for _ in range(MOST_AT_ONCE):
            if lcm.handle_timeout(0) <= 0:
                return

    def _look_for_others(self) -> None:
        """Ask whether a session is there already: two would answer each other's drivers."""
        request = mode_t()
        request.sender, request.mode = int.from_bytes(os.urandom(7), "little"), Mode.READY
        senders: list[int] = []
        self._lcm.subscribe(connection.GRANT, lambda _, data: senders.append(grant_t.decode(data).sender))
        self._publish(connection.MODE, request.encode())
        until = monotonic() + ANSWER
        while (left := until - monotonic()) > 0.0:
            self.receive(left)
            if request.sender in senders:
                raise TransportError(f"another session is running at {self.url}: end it, or take another --url")

    def _show(self, view: View) -> None:
        message = self._encoder.world(self._trial, view.tick, view.time, view.state, view.labels)
        self._publish(connection.WORLD, message)
        if self._caption.update(view.labels) or view.tick == 0:
            labels = labels_t()
            labels.trial, labels.tick, labels.time = self._trial, view.tick, view.time
            labels.label = self._caption.words
            labels.labels = len(labels.label)
            self._publish(connection.LABELS, labels.encode())

    def _publish(self, channel: str, message: bytes) -> None:
        self._lcm.publish(channel, message)

    def _commanded(self, car: str) -> Callable[[str, bytes], None]:
        def take(_channel: str, data: bytes) -> None:
            try:
                command = command_t.decode(data)
            except GARBAGE as error:
                self._mailbox.fault(car, End.PEER_GARBAGE, f"not a command_t of {len(data)} bytes: {error}")
                return
            if command.trial != self._trial:
                return  # of a trial that is over
            if command.gives_up:
                detail = f"the controller gave up at tick {command.tick}"
                self._mailbox.fault(car, End.GAVE_UP, detail)
            else:
                self._mailbox.command(car, command.speed, command.yaw_rate, command.tick)

        return take

    def _mode_requested(self, _channel: str, data: bytes) -> None:
        try:
            asked = mode_t.decode(data)
        except GARBAGE:
            return  # nobody can be told
        self._grant(asked)

    def _grant(self, asked: mode_t) -> None:
        """Answer a request; one that can't be answered before the next instance is up waits for it."""
        granted: bool | None = asked.mode in (Mode.READY, Mode.START)
        if self._maestro is not None:
            granted = self._maestro.answer(asked.mode)
        if granted is None:
            self._waiting.append(asked)
            return
        grant = grant_t()
        grant.sender, grant.mode, grant.result = asked.sender, asked.mode, granted
        self._publish(connection.GRANT, grant.encode())
        if asked.mode == Mode.READY and self._announced:
            self._publish(connection.INSTANCE, self._announced)
