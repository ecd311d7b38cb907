"""The topics and the mode service of 2016, as ROS 2 would have them, as a `protocols.Transport`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from time import monotonic, time_ns
from typing import TYPE_CHECKING, Any

from dubins_traffic.problem.document import instance_to_document
from dubins_traffic.protocols import Ending, Mailbox, View
from dubins_traffic.transports.maestro import Maestro, Mode
from dubins_traffic.transports.ros2 import messages as m
from dubins_traffic.transports.ros2.graph import Graph, usual_domain
from dubins_traffic.transports.ros2.world import World

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

INSTANCE = "rt/dubins_traffic_maestro/probleminstance_JSON"
REQUESTS = "rq/dubins_traffic_maestro/modeRequest"
REPLIES = "rr/dubins_traffic_maestro/modeReply"
COMMANDS = "rt/{}/mobile_base/commands/velocity"
AT_ONCE = 100
"""Messages of one topic taken at a time."""
LOOK = 0.1
"""Seconds between two looks at who is there."""


class Ros2:
    """Topics and the mode service of 2016 under ROS 2's names, by DDS (a `protocols.Transport`).

    Twists carry no tick: in lockstep a peer shall publish exactly one for each `/gazebo/model_states`, which is the
    last message of a frame.

    Parameters
    ----------
    domain : int, optional
        Number of the DDS domain; by default that of ``ROS_DOMAIN_ID``, else 0.
    maestro : Maestro, optional
        Who grants modes; without one trials start by themselves.
    here : bool
        Whether nothing leaves this machine.
    """

    name = "ros2"
    tagged = False

    def __init__(
        self, domain: int | None = None, *, maestro: Maestro | None = None, here: bool = True
    ) -> None:
        self._domain = usual_domain() if domain is None else domain
        self._maestro, self._here = maestro, here
        self._readers: dict[str, Any] = {}
        self._there: dict[str, int] = {}
        self._looked = 0.0
        self._open = False

    def open(self, mailbox: Mailbox) -> None:
        """Join the domain; TransportError if that can't be."""
        self._mailbox = mailbox
        self._graph = Graph(self._domain, here=self._here)
        self._open = True
        self._world = World(self._graph)
        self._problem = self._graph.writer(INSTANCE, m.ProblemInstanceJSON, latched=True)
        self._requests: Any = None
        if self._maestro is not None:
            self._requests = self._graph.reader(REQUESTS, m.ModeRequest)
            self._replies = self._graph.writer(REPLIES, m.ModeReply)

    def begin(self, instance: Instance, remote: Sequence[str]) -> None:
        """Listen to the drivers of the cars `remote`."""
        self._world.begin(instance)
        for car in [car for car in self._readers if car not in remote]:
            self._graph.drop(self._readers.pop(car))
            self._there.pop(car)
        for car in remote:
            if car not in self._readers:
                self._readers[car] = self._graph.reader(COMMANDS.format(car), m.Twist)
                self._there[car] = 0

    def announce(self, instance: Instance) -> None:
        """Publish the problem instance, as in 2016."""
        document = json.dumps(instance_to_document(instance, version=0))
        self._graph.put(self._problem, m.ProblemInstanceJSON(_now(), document))

    def frame(self, view: View) -> None:
        """Publish a frame."""
        self._world.publish(view, _now())

    def end(self, ending: Ending) -> None:  # noqa: ARG002  # in 2016 nobody was told why
        """Publish the empty instance that ends a trial."""
        self._graph.put(self._problem, m.ProblemInstanceJSON(_now(), ""))

    def receive(self, seconds: float) -> None:
        """Take what has come, or comes within so long."""
        if seconds > 0.0:
            self._graph.wait(seconds)
        if self._requests is not None:
            for request in self._graph.take(self._requests, m.ModeRequest, AT_ONCE):
                self._reply(request)
        for car, reader in self._readers.items():
            for twist in self._graph.take(reader, m.Twist, AT_ONCE):
                self._mailbox.command(car, twist.linear.x, twist.angular.z)
        if monotonic() - self._looked > LOOK:
            self._looked = monotonic()
            self._look()

    def close(self) -> None:
        """Leave the domain."""
        if self._open:
            self._open = False
            self._readers.clear()
            self._graph.close()

    def _reply(self, request: m.ModeRequest) -> None:
        assert self._maestro is not None
        granted = self._maestro.request(request.mode)
        if granted and request.mode == Mode.START:
            self._mailbox.pause(False)
        self._graph.put(self._replies, m.ModeReply(request.guid, request.seq, granted))

    def _look(self) -> None:
        """Tell the mailbox who has come and gone."""
        for car, reader in self._readers.items():
            there = len(reader.get_matched_publications())
            for _ in range(there, self._there[car]):
                self._mailbox.left(car)
            for _ in range(self._there[car], there):
                self._mailbox.joined(car)
            self._there[car] = there


def _now() -> m.Time:
    seconds, nanoseconds = divmod(time_ns(), 1_000_000_000)
    return m.Time(seconds, nanoseconds)
