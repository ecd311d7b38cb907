"""The topics and the mode service of 2016, as ROS 2 would have them, as a `protocols.Transport`.

What the maestro of 2016 served is there as services and topics: modes, the instance, pausing, placing cars.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from threading import Lock
from time import monotonic, sleep
from typing import TYPE_CHECKING, Any

from dubins_traffic.errors import TransportError
from dubins_traffic.problem.document import instance_to_document
from dubins_traffic.protocols import Ending, Mailbox, View
from dubins_traffic.transports.maestro import Maestro, Mode, closing_if_refused
from dubins_traffic.transports.ros import Stamps, placed
from dubins_traffic.transports.ros2 import messages as m
from dubins_traffic.transports.ros2.graph import Graph, usual_domain
from dubins_traffic.transports.ros2.world import Ros2Publishers, moment

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

INSTANCE = "rt/dubins_traffic_maestro/probleminstance_JSON"
MODE = "dubins_traffic_maestro/mode"
PAUSE, UNPAUSE = "gazebo/pause_physics", "gazebo/unpause_physics"
PLACE = "rt/gazebo/set_model_state"
AT_ONCE = 100
"""Messages of one topic taken at a time."""
MOST_WAITING = 1000
"""Requests that may wait for the next instance; what is asked beyond is never answered."""


@dataclass(frozen=True, slots=True)
class _Service:
    """A service of ROS 2: a topic of requests, one of replies, and who answers, with None for "not yet"."""

    requests: Any
    kind: Any
    replies: Any
    answer: Callable[[Any], Any]


class MaestroServices:
    """Answers requests, and tells the problem.

    Parameters
    ----------
    maestro : Maestro, optional
        Who answers mode requests; without one there is no mode service.
    """

    def __init__(self, graph: Graph, mailbox: Mailbox, maestro: Maestro | None) -> None:
        self._graph, self._mailbox, self._maestro = graph, mailbox, maestro
        self._problem = graph.writer(INSTANCE, m.ProblemInstanceJSON, latched=True)
        self._places = graph.reader(PLACE, m.ModelState)
        self._waiting: list[tuple[_Service, Any]] = []
        self._services = [
            self._service(PAUSE, m.EmptyRequest, m.EmptyReply, partial(self._pause, True)),
            self._service(UNPAUSE, m.EmptyRequest, m.EmptyReply, partial(self._pause, False)),
        ]
        if maestro is not None:
            self._services.append(self._service(MODE, m.ModeRequest, m.ModeReply, self._mode))

    def begin(self) -> None:
        """Take back the end of the trial before: who comes now would take it for the next one's."""
        self._graph.lift(self._problem, m.ProblemInstanceJSON)

    def announce(self, instance: Instance, stamp: m.Time) -> None:
        """Publish the problem, latched, as in 2016."""
        self._publish(json.dumps(instance_to_document(instance, version=0)), stamp)

    def end(self, stamp: m.Time) -> None:
        """Publish that the trial is over."""
        self._publish("", stamp)

    def serve(self) -> None:
        """Answer what has been asked."""
        asked, self._waiting = self._waiting, []
        for service in self._services:
            asked += [(service, one) for one in self._graph.take(service.requests, service.kind, AT_ONCE)]
        for service, request in asked:
            reply = service.answer(request)
            if reply is not None:
                self._graph.put(service.replies, reply)
            elif len(self._waiting) < MOST_WAITING:
                self._waiting.append((service, request))
        for message in self._graph.take(self._places, m.ModelState, AT_ONCE):
            position, turn = message.pose.position, message.pose.orientation
            pose = placed(position.x, position.y, turn.z, turn.w)
            if pose is not None:
                self._mailbox.place(message.model_name, pose)

    def _service(self, name: str, request: Any, reply: Any, answer: Callable[[Any], Any]) -> _Service:
        requests = self._graph.reader(f"rq/{name}Request", request)
        return _Service(requests, request, self._graph.writer(f"rr/{name}Reply", reply), answer)

    def _publish(self, text: str, stamp: m.Time) -> None:
        self._graph.put(self._problem, m.ProblemInstanceJSON(stamp, text))

    def _mode(self, request: m.ModeRequest) -> m.ModeReply | None:
        assert self._maestro is not None
        granted = self._maestro.answer(request.mode)
        if granted is None:
            return None
        if granted and request.mode == Mode.START:
            self._mailbox.pause(False)
        return m.ModeReply(request.guid, request.seq, granted)

    def _pause(self, paused: bool, request: m.EmptyRequest) -> m.EmptyReply:
        self._mailbox.pause(paused)
        return m.EmptyReply(request.guid, request.seq)


COMMANDS = "rt/{}/mobile_base/commands/velocity"
LOOK = 0.1
"""Seconds between two looks at who is there."""
MEET = 0.3
"""Seconds in which another session in the domain would be found."""


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
    clock : bool
        Whether `/clock` is published and messages are stamped with simulated time; else with the wall clock's.
    rate : float
        How many model states a second are published in real time, at least.
    """

    name = "ros2"
    tagged = False

    def __init__(
        self,
        domain: int | None = None,
        *,
        maestro: Maestro | None = None,
        here: bool = True,
        clock: bool = False,
        rate: float = 120.0,
    ) -> None:
        self.interval = 1.0 / rate
        self._clock, self._stamps = clock, Stamps(self.interval, clock=clock)
        self.domain = usual_domain() if domain is None else domain
        self._maestro, self._here = maestro, here
        self._readers: dict[str, Any] = {}
        self._there: dict[str, int] = {}
        self._looking = Lock()
        self._looked = 0.0
        self._open = False

    def open(self, mailbox: Mailbox) -> None:
        """Join the domain; TransportError if that can't be."""
        self._mailbox = mailbox
        self._graph = Graph(self.domain, here=self._here)
        self._open = True
        with closing_if_refused(self.close):
            self._look_for_others()
        self._world = Ros2Publishers(self._graph, clock=self._clock)
        self._services = MaestroServices(self._graph, mailbox, self._maestro)

    def begin(self, instance: Instance, remote: Sequence[str]) -> None:
        """Listen to the drivers of the cars `remote`."""
        self._stamps.begin()
        self._services.begin()
        self._world.begin(instance)
        with self._looking:
            for car in [car for car in self._readers if car not in remote]:
                self._graph.drop(self._readers.pop(car))
                self._there.pop(car)
            for car in remote:
                if car not in self._readers:
                    self._readers[car] = self._graph.reader(COMMANDS.format(car), m.Twist)
                    self._there[car] = 0

    def announce(self, instance: Instance) -> None:
        """Publish the problem instance."""
        self._services.announce(instance, moment(self._stamps.now()))

    def frame(self, view: View) -> None:
        """Publish a frame."""
        self._publish(view, frame=True)

    def stream(self, view: View) -> None:
        """Publish what lies between two frames, or a world that stands still."""
        self._publish(view, frame=False)

    def end(self, ending: Ending) -> None:  # noqa: ARG002  # in 2016 nobody was told why
        """Publish the empty instance that ends a trial."""
        self._services.end(moment(self._stamps.now()))

    def receive(self, seconds: float) -> None:
        """Take what has come, or comes within so long."""
        if seconds > 0.0:
            self._graph.wait(seconds)
        self._services.serve()
        for car, reader in self._readers.items():
            for twist in self._graph.take(reader, m.Twist, AT_ONCE):
                self._mailbox.command(car, twist.linear.x, twist.angular.z)
        if monotonic() - self._looked > LOOK:
            self._looked = monotonic()
            self.look()

    def look(self) -> None:
        """Tell the mailbox who has come and gone, as far as DDS knows: of who was killed it knows after seconds."""
        with self._looking:
            for car, reader in self._readers.items():
                there = self._graph.writers(reader)
                for _ in range(there, self._there[car]):
                    self._mailbox.left(car)
                for _ in range(self._there[car], there):
                    self._mailbox.joined(car)
                self._there[car] = there

    def close(self) -> None:
        """Leave the domain."""
        if self._open:
            self._open = False
            self._readers.clear()
            self._graph.close()

    def _look_for_others(self) -> None:
        """See that nobody else tells problems here: two sessions would answer each other's drivers."""
        probe = self._graph.reader(INSTANCE, m.ProblemInstanceJSON)
        until = monotonic() + MEET
        while monotonic() < until:
            if self._graph.writers(probe):
                raise TransportError(
                    f"another session is running in DDS domain {self.domain}, or was killed some seconds ago: "
                    "end it, or take another --domain"
                )
            sleep(0.02)
        self._graph.drop(probe)

    def _publish(self, view: View, *, frame: bool) -> None:
        self._stamps.see(view)
        self._world.publish(view, self._stamps.now(), self._stamps.simulated, frame=frame)
