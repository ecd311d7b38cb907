"""The topics of 2016, as ROS 2 would have them, as a `protocols.Transport`.

What the maestro of 2016 served is there as topics: modes, the instance, pausing, placing cars. There are no services:
implementations of DDS carry them in unlike ways, and a client of another one than ours would wait for ever.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from threading import Lock
from time import monotonic, sleep
from typing import TYPE_CHECKING, Any

from dubins_traffic.errors import TransportError
from dubins_traffic.problem.document import instance_to_document
from dubins_traffic.protocols import Ending, Mailbox, View
from dubins_traffic.transports.maestro import ForeignMaestro, Maestro, Mode, closing_if_refused
from dubins_traffic.transports.ros import Stamps, placed
from dubins_traffic.transports.ros2 import messages as m
from dubins_traffic.transports.ros2.graph import Graph, usual_domain
from dubins_traffic.transports.ros2.world import Ros2Publishers

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

INSTANCE = "rt/dubins_traffic_maestro/probleminstance_JSON"
ASK, ANSWER = "rt/dubins_traffic_maestro/ask", "rt/dubins_traffic_maestro/answer"
PAUSE, UNPAUSE = "PAUSE", "UNPAUSE"
AT_ONCE = 100
"""Messages of one topic taken at a time."""
MOST_WAITING = 1000
"""What is asked may wait for the next instance, so much of it; what is asked beyond is never answered."""


class MaestroTopics:
    """Answers what is asked, and tells the problem.

    Parameters
    ----------
    maestro : Maestro, optional
        Who grants modes; without one none is granted.
    simulated : bool
        Whether the cars are simulated here, so that pausing is granted.
    """

    def __init__(self, graph: Graph, mailbox: Mailbox, maestro: Maestro | None, *, simulated: bool) -> None:
        self._graph, self._mailbox, self._maestro = graph, mailbox, maestro
        self._simulated = simulated
        self._problem = graph.writer(INSTANCE, m.String, latched=True)
        self._asked = graph.reader(ASK, m.String)
        self._answers = graph.writer(ANSWER, m.String)
        self._waiting: list[str] = []

    def announce(self, instance: Instance) -> None:
        """Publish the problem, latched, as in 2016."""
        self._graph.put(self._problem, m.String(json.dumps(instance_to_document(instance, version=0))))

    def end(self) -> None:
        """Publish that no trial runs: latched, too, since nothing may follow at once that would take its place."""
        self._graph.put(self._problem, m.String())

    def serve(self) -> None:
        """Answer what has been asked."""
        asked, self._waiting = self._waiting, []
        asked += [each.data.strip() for each in self._graph.take(self._asked, m.String, AT_ONCE)]
        for word in asked:
            granted = self._granted(word)
            if granted is not None:
                self._graph.put(self._answers, m.String(f"{word} {'granted' if granted else 'refused'}"))
            elif len(self._waiting) < MOST_WAITING:
                self._waiting.append(word)

    def _granted(self, word: str) -> bool | None:
        """Do what is asked; return whether it is granted, None for "not yet"."""
        if word in (PAUSE, UNPAUSE):
            if self._simulated:
                self._mailbox.pause(word == PAUSE)
            return self._simulated
        if self._maestro is None or word not in Mode.__members__:
            return False
        granted = self._maestro.answer(Mode[word])
        if granted and Mode[word] is Mode.START:
            self._mailbox.pause(False)
        return granted


class ForeignTopics:
    """Hears what another maestro tells; it answers what is asked, and this does not.

    Parameters
    ----------
    foreign : ForeignMaestro
        Is told it.
    """

    def __init__(self, graph: Graph, foreign: ForeignMaestro) -> None:
        self._graph, self._foreign = graph, foreign
        self._problems = graph.reader(INSTANCE, m.String, latched=True)

    def announce(self, instance: Instance) -> None:
        """Do nothing: the other maestro has told the problem."""

    def end(self) -> None:
        """Do nothing: the other maestro tells it."""

    def serve(self) -> None:
        """Hear what has come."""
        for message in self._graph.take(self._problems, m.String, AT_ONCE):
            self._foreign.tell(message.data)


COMMANDS = "rt/{}/mobile_base/commands/velocity"
PLACE = "rt/{}/place"
LOOK = 0.1
"""Seconds between two looks at who is there."""
MEET = 0.3
"""Seconds in which another session in the domain would be found."""


class Ros2:
    """Topics of 2016 under ROS 2's names, by DDS (a `protocols.Transport`).

    Twists carry no tick: in lockstep a peer shall publish exactly one for each `/ego/odom`, which is the last message
    of a frame.

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
        How many views of the world a second are published in real time, at least.
    simulated : bool
        Whether the cars are simulated here; else only labels are published, and what is the maestro's.
    markers : bool
        Whether markers for RViz are published (`transports.marks`).
    foreign : ForeignMaestro, optional
        Another process is the maestro, and this is told what that says.
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
        simulated: bool = True,
        markers: bool = False,
        foreign: ForeignMaestro | None = None,
    ) -> None:
        self.interval = 1.0 / rate
        self._clock, self._stamps = clock, Stamps(self.interval, clock=clock)
        self.domain = usual_domain() if domain is None else domain
        self._maestro, self._here = maestro, here
        self._simulated_here, self._markers, self._foreign = simulated, markers, foreign
        self._readers: dict[str, Any] = {}
        self._there: dict[str, int] = {}
        self._places: dict[str, Any] = {}
        self._looking = Lock()
        self._looked = 0.0
        self._open = False

    @property
    def graph(self) -> Graph:
        """The participant, once the transport is open."""
        return self._graph

    def open(self, mailbox: Mailbox) -> None:
        """Join the domain; TransportError if that can't be."""
        self._mailbox = mailbox
        self._graph = Graph(self.domain, here=self._here)
        self._open = True
        self._world = Ros2Publishers(
            self._graph, clock=self._clock, simulated=self._simulated_here, markers=self._markers
        )
        if self._foreign is not None:
            self._topics = ForeignTopics(self._graph, self._foreign)
            return
        with closing_if_refused(self.close):
            self._look_for_others()
        self._topics = MaestroTopics(self._graph, mailbox, self._maestro, simulated=self._simulated_here)

    def begin(self, instance: Instance, remote: Sequence[str]) -> None:
        """Listen to the drivers of the cars `remote`."""
        self._stamps.begin()
        self._world.begin(instance)
        placed_here = instance.names if self._simulated_here else ()
        for car in sorted(set(placed_here).symmetric_difference(self._places)):
            if car in self._places:
                self._graph.drop(self._places.pop(car))
            else:
                self._places[car] = self._graph.reader(PLACE.format(car), m.PoseStamped)
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
        self._topics.announce(instance)

    def frame(self, view: View) -> None:
        """Publish a frame."""
        self._stamps.see(view)
        self._world.publish(view, self._stamps.now(), self._stamps.simulated)

    stream = frame

    def end(self, ending: Ending) -> None:  # noqa: ARG002  # in 2016 nobody was told why
        """Publish the empty instance that ends a trial."""
        self._topics.end()

    def receive(self, seconds: float) -> None:
        """Take what has come, or comes within so long."""
        if seconds > 0.0:
            self._graph.wait(seconds)
        self._topics.serve()
        for car, reader in self._places.items():
            for message in self._graph.take(reader, m.PoseStamped, AT_ONCE):
                pose = placed(message.pose)
                if pose is not None:
                    self._mailbox.place(car, pose)
        for car, reader in self._readers.items():
            for twist in self._graph.take(reader, m.Twist, AT_ONCE):
                self._mailbox.command(car, twist.linear.x, twist.angular.z)
        if monotonic() - self._looked > LOOK:
            self._looked = monotonic()
            self.look()

    def look(self) -> None:
        """Tell the mailbox who has come and gone."""
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
            self._places.clear()
            self._graph.close()

    def _look_for_others(self) -> None:
        """See that nobody else tells problems here: two sessions would answer each other's drivers."""
        probe = self._graph.reader(INSTANCE, m.String)
        until = monotonic() + MEET
        while monotonic() < until:
            if self._graph.writers(probe):
                raise TransportError(
                    f"another session is running in DDS domain {self.domain}, or was killed some seconds ago: "
                    "end it, or take another --domain"
                )
            sleep(0.02)
        self._graph.drop(probe)
