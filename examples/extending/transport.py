"""A transport of one's own in one file: JSON in UDP datagrams on this machine.

A peer sends ``{"join": "ego"}``. It is sent ``{"problem": ...}``, ``{"frame": ...}`` each tick and ``{"end": ...}``,
and answers frames with ``{"command": [speed, yaw rate], "tick": k}``. docs/extending/transport.md explains it.
"""

from __future__ import annotations

import contextlib
import json
import select
import socket
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from dubins_traffic.errors import TransportError
from dubins_traffic.problem.public_problem import problem_to_document
from dubins_traffic.protocols import End, Ending, Mailbox, View
from dubins_traffic.sessions.registry import Option, TransportEntry
from dubins_traffic.transports.line_messages import observation_to_document

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance
    from dubins_traffic.runs.single import Result
    from dubins_traffic.sessions.plan import Pace, SessionPlan

Address = tuple[str, int]
LONGEST = 65_507
"""Bytes of a datagram, at most: enough for the problem of a network of some hundred segments."""
MOST_AT_ONCE = 256
"""Datagrams after which the trial is looked at again, however many there are."""


class Datagrams:
    """JSON in UDP datagrams (a `protocols.Transport`, `protocols.Polled`).

    Parameters
    ----------
    port : int
        Where to listen on the loopback interface; 0 takes any free port, see `address`.
    """

    name = "datagrams"
    tagged = True

    def __init__(self, port: int = 0) -> None:
        self._port = port
        self._cars: Mapping[str, int] = {}
        self._drivers: dict[Address, str] = {}
        self._problem: Mapping[str, Any] | None = None
        self._open = False

    @property
    def address(self) -> Address:
        """Host and port at which it listens."""
        host, port = self._socket.getsockname()
        return str(host), int(port)

    def open(self, mailbox: Mailbox) -> None:
        """Listen; TransportError if the port is taken."""
        self._mailbox = mailbox
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind(("127.0.0.1", self._port))
        except OSError as error:
            self._socket.close()
            raise TransportError(f"can't listen on port {self._port}: {error.strerror}") from error
        self._socket.setblocking(False)
        self._open = True

    def begin(self, instance: Instance, remote: Sequence[str]) -> None:
        """Note the cars; the problem is not told yet."""
        self._cars = {name: n for n, name in enumerate(instance.names) if name in remote}
        self._problem = None

    def announce(self, instance: Instance) -> None:
        """Send the problem to all drivers; who comes later is sent it on joining."""
        self._problem = {"problem": problem_to_document(instance.problem)}
        self._send_all(self._problem)

    def frame(self, view: View) -> None:
        """Send every driver the observation of its own car."""
        if not view.running:
            return
        for address, car in self._drivers.items():
            if car in self._cars:
                self._send(address, {"frame": observation_to_document(view.observe(self._cars[car]))})

    def end(self, ending: Ending) -> None:
        """Say that the trial is over."""
        self._problem = None
        self._send_all({"end": asdict(ending)})

    def close(self) -> None:
        """Free the port."""
        if self._open:
            self._open = False
            self._socket.close()

    def receive(self, seconds: float) -> None:
        """Wait for a datagram, so long at most, and take all that have come."""
        select.select([self._socket], [], [], max(0.0, seconds))
        for _ in range(MOST_AT_ONCE):
            try:
                data, address = self._socket.recvfrom(LONGEST)
            except OSError:
                return  # nothing more has come
            try:
                self._take(address, json.loads(data))
            except (ValueError, OverflowError, RecursionError):
                car = self._drivers.get(address, "")
                self._mailbox.fault(car, End.PEER_GARBAGE, f"not a message: {data[:60]!r}")

    def _take(self, address: Address, message: Any) -> None:
        """Do what a message says; ValueError or OverflowError if it says nothing that is known."""
        match message:
            case {"join": str(car)}:
                self._drivers[address] = car
                if self._problem is not None:
                    self._send(address, self._problem)
            case {"command": [float() | int() as speed, float() | int() as yaw_rate], "tick": int(tick)}:
                car = self._drivers.get(address, "")
                self._mailbox.command(car, float(speed), float(yaw_rate), tick)
            case _:
                raise ValueError("unknown message")

    def _send_all(self, message: Mapping[str, Any]) -> None:
        for address in self._drivers:
            self._send(address, message)

    def _send(self, address: Address, message: Mapping[str, Any]) -> None:
        with contextlib.suppress(OSError):  # what can't be sent is lost, as any datagram may be
            self._socket.sendto(json.dumps(message).encode(), address)


def run_over_datagrams(session_plan: SessionPlan, pace: Pace, *, port: int = 0) -> Iterator[Result]:
    """Run the trials of `session_plan` and yield their results."""
    transport = Datagrams(port)
    yield from session_plan.over(transport, pace, at=lambda: f"datagrams at port {transport.address[1]}")


ENTRY = TransportEntry(
    runs=run_over_datagrams,
    line="Trials over UDP datagrams on this machine.",
    about="Run trials whose ego, or some of whose e-agents, are driven by datagrams.",
    examples=("datagrams run demo --lockstep --port 7412",),
    options=(Option("--port", int, "Where to listen; 0: any free one.", default=0, metavar="PORT", low=0, high=65535),),
)
