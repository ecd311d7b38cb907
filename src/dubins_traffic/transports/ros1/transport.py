"""The interface of 2016 over ROS 1 as a `protocols.Transport`, and what the maestro of 2016 served.

That is parameters, the mode service, the problem instance, pausing, and placing cars.
"""

from __future__ import annotations

import json
import select
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from threading import Lock
from typing import TYPE_CHECKING, Any
from xmlrpc.client import Error as XmlRpcError

from dubins_traffic.cars.body import Rectangle
from dubins_traffic.problem.document import instance_to_document
from dubins_traffic.protocols import End, Ending, Mailbox, View
from dubins_traffic.transports.maestro import ForeignMaestro, Maestro, Mode
from dubins_traffic.transports.ros import Stamps, placed
from dubins_traffic.transports.ros1.messages import load
from dubins_traffic.transports.ros1.node import NAME, REFEREE, Watch, abandon, join, tell_first
from dubins_traffic.transports.ros1.world import QUEUE, Ros1Publishers, Topics

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

PROBLEM = f"/{NAME}/probleminstance_JSON"


@dataclass(frozen=True, slots=True)
class SessionParameters:
    """What parameters say of the whole session, as in 2016.

    `number_trials` is None for trials without end; bounds are [low, high]; `results_file` is the trial data file.
    """

    number_trials: int | None = None
    duration_bounds: Sequence[int] | None = None
    number_goals_bounds: Sequence[int] | None = None
    results_file: str | None = None


class MaestroServices:
    """Services, parameters and the latched problem instance.

    Parameters
    ----------
    maestro : Maestro, optional
        Who answers mode requests; without one there is no mode service.
    simulated : bool
        Whether the cars are simulated here, so that pausing and placing them is served.
    foreign : ForeignMaestro, optional
        Another maestro: problems are heard from it instead of told, and what it has set of the parameters stays.
    """

    def __init__(
        self,
        rospy: Any,
        mailbox: Mailbox,
        maestro: Maestro | None,
        parameters: SessionParameters,
        *,
        simulated: bool = True,
        foreign: ForeignMaestro | None = None,
    ) -> None:
        m = load()
        self._rospy, self._m, self._mailbox, self._maestro = rospy, m, mailbox, maestro
        self._foreign = foreign
        self._set: list[str] = []
        if foreign is None:
            self._problem = rospy.Publisher(
                PROBLEM, m.ProblemInstanceJSON, queue_size=QUEUE, latch=True, tcp_nodelay=True
            )
        else:
            self._problem = rospy.Subscriber(PROBLEM, m.ProblemInstanceJSON, self._hear, queue_size=10)
        self._services: list[Any] = []
        self._placing: Any = None
        if simulated:
            self._services += [
                rospy.Service("/gazebo/pause_physics", m.Empty, partial(self._pause, True)),
                rospy.Service("/gazebo/unpause_physics", m.Empty, partial(self._pause, False)),
            ]
            self._placing = rospy.Subscriber("/gazebo/set_model_state", m.ModelState, self._place, queue_size=10)
        if maestro is not None:
            self._services.append(rospy.Service(f"/{NAME}/mode", m.MMode, self._mode))
        self._put("/number_trials", parameters.number_trials)
        self._put("/dubins_traffic/results_file", parameters.results_file)
        for name, bounds in (
            ("duration", parameters.duration_bounds),
            ("number_goals", parameters.number_goals_bounds),
        ):
            self._put(f"/{NAME}/{name}_bounds", None if bounds is None else f"{bounds[0]} {bounds[1]}")

    def describe(self, instance: Instance) -> None:
        """Set the parameters that follow from the instance that is up."""
        self._put("/dubins_traffic/rnd", json.dumps(instance.problem.network.to_document()))
        self._put("/dubins_traffic/e_agents", ",".join(instance.names[1:]))
        self._put("/robot_description", robot_description(instance))

    def announce(self, instance: Instance, stamp: float) -> None:
        """Publish the problem, latched."""
        self._publish(json.dumps(instance_to_document(instance, version=0)), stamp)

    def end(self, stamp: float) -> None:
        """Publish that the trial is over. Who comes later is not told: he would take it for the next trial's end."""
        self._publish("", stamp)
        if self._foreign is None:
            self._problem.impl.latch = None

    def close(self, *, forget: bool = True) -> None:
        """Take everything back; unless `forget`, parameters stay, which may be another maestro's by now."""
        for service in self._services:
            service.shutdown("the session is over")
        if self._placing is not None:
            self._placing.unregister()
        self._problem.unregister()
        for name in self._set if forget else ():
            if self._rospy.has_param(name):
                self._rospy.delete_param(name)

    def _publish(self, text: str, stamp: float) -> None:
        if self._foreign is not None:
            return
        self._problem.publish(self._rospy.Time.from_sec(stamp), text)

    def _put(self, name: str, value: object) -> None:
        if value is None or (self._foreign is not None and self._rospy.has_param(name)):
            return
        self._rospy.set_param(name, value)
        if name not in self._set:
            self._set.append(name)

    def _hear(self, message: Any) -> None:
        assert self._foreign is not None
        self._foreign.tell(message.problemjson)

    def _mode(self, request: Any) -> Any:
        assert self._maestro is not None
        granted = self._maestro.request(request.mode)
        if granted and request.mode == Mode.START:
            self._mailbox.pause(False)
        return self._m.MModeResponse(granted)

    def _pause(self, paused: bool, _request: Any) -> Any:
        self._mailbox.pause(paused)
        return self._m.EmptyResponse()

    def _place(self, message: Any) -> None:
        pose = placed(message.pose)
        if pose is not None:
            self._mailbox.place(message.model_name, pose)


def robot_description(instance: Instance) -> str:
    """Return the cars' body as a URDF document, for programs that draw it."""
    body = instance.problem.car.body
    if isinstance(body, Rectangle):
        shape = f'<box size="{body.length} {body.width} 0.1"/>'
    else:
        shape = f'<cylinder radius="{body.radius}" length="0.1"/>'
    solid = f'<origin xyz="0 0 0.05"/><geometry>{shape}</geometry>'
    return (
        '<?xml version="1.0"?><robot name="car"><link name="base_footprint"/>'
        f'<link name="base_link"><visual>{solid}</visual><collision>{solid}</collision></link>'
        '<joint name="base_joint" type="fixed"><origin xyz="0 0 0.0102"/>'
        '<parent link="base_footprint"/><child link="base_link"/></joint></robot>'
    )


COMMANDS = "/{}/mobile_base/commands/velocity"


class Ros1:
    """Simulator, maestro and monitor of 2016 in this process.

    Twists carry no tick: in lockstep a peer shall publish exactly one for each `/gazebo/model_states`, which is the
    last message of a frame.

    Parameters
    ----------
    uri : str
        The ROS master's.
    maestro : Maestro, optional
        Who grants modes; without one trials start by themselves.
    clock : bool
        Whether `/clock` is published and messages are stamped with simulated time; else with the wall clock's.
    simulated : bool
        Whether the cars are simulated here; else only labels are published, and what is the maestro's.
    rate : float
        How many model states a second are published in real time, at least.
    foreign : ForeignMaestro, optional
        Another process is the maestro, and this is told what that says.
    """

    name = "ros1"
    tagged = False

    def __init__(
        self,
        uri: str,
        *,
        maestro: Maestro | None = None,
        parameters: SessionParameters | None = None,
        clock: bool = False,
        simulated: bool = True,
        rate: float = 120.0,
        foreign: ForeignMaestro | None = None,
    ) -> None:
        self.interval = 1.0 / rate
        self._uri, self._maestro, self._parameters, self._clock = (
            uri,
            maestro,
            parameters or SessionParameters(),
            clock,
        )
        self._stamps = Stamps(self.interval, clock=clock)
        self._simulated_here, self._foreign = simulated, foreign
        self._world: Ros1Publishers | None = None
        self._subscribers: dict[str, Any] = {}
        self._there: dict[str, int] = {}
        self._spoke: set[str] = set()
        self._met: set[str] = set()
        self._looking = Lock()
        self._open = self._lost = False

    @property
    def rospy(self) -> Any:
        """The module, with this process a node once the transport is open."""
        return self._rospy

    def open(self, mailbox: Mailbox) -> None:
        """Join the graph; TransportError or MissingRosError if that can't be."""
        self._rospy = join(self._uri, NAME if self._foreign is None else REFEREE)
        self._mailbox = mailbox
        self._topics = Topics(self._rospy)
        self._services = MaestroServices(
            self._rospy,
            mailbox,
            self._maestro,
            self._parameters,
            simulated=self._simulated_here,
            foreign=self._foreign,
        )
        self._watch = Watch(self._uri, self.look, self._lose)
        self._open = True
        tell_first(self._rospy, self._displaced)

    def begin(self, instance: Instance, remote: Sequence[str]) -> None:
        """Put up the topics of the instance's cars, and listen to those that are remote."""
        with self._guarded():
            self._topics.retain(instance.names)
            self._world = Ros1Publishers(self._topics, instance, clock=self._clock, simulated=self._simulated_here)
            self._services.describe(instance)
            self._listen(remote)
        self._stamps.begin()

    def announce(self, instance: Instance) -> None:
        """Publish the problem instance."""
        with self._guarded():
            self._services.announce(instance, self._stamps.now())

    def frame(self, view: View) -> None:
        """Publish a frame."""
        self._publish(view, frame=True)

    def stream(self, view: View) -> None:
        """Publish what lies between two frames, or a world that stands still."""
        self._publish(view, frame=False)

    def end(self, ending: Ending) -> None:  # noqa: ARG002  # in 2016 nobody was told why
        """Publish the empty instance that ends a trial."""
        with self._guarded():
            self._services.end(self._stamps.now())

    def close(self) -> None:
        """Take back what this session has put into the graph; the node itself stays until the process ends."""
        if not self._open:
            return
        self._open = False
        self._watch.close()
        with self._guarded():
            self._topics.close()
            self._listen(())
            self._services.close(forget=not self._lost)

    def look(self) -> None:
        """Tell the mailbox which drivers have come and gone, those that came, spoke and went between two looks too."""
        with self._looking:
            for car, subscriber in self._subscribers.items():
                before, was_heard = self._there.get(car, 0), car in self._spoke
                there = self._there[car] = connections(subscriber)
                most = max(before, there)
                if most == 0 and was_heard and car not in self._met:
                    most = 1
                if most > 0:
                    self._met.add(car)
                for _ in range(before, most):
                    self._mailbox.joined(car)
                for _ in range(there, most):
                    self._mailbox.left(car)

    def _listen(self, remote: Sequence[str]) -> None:
        """Subscribe to the commands of the cars `remote`, and to no others."""
        with self._looking:
            for car in [car for car in self._subscribers if car not in remote]:
                self._subscribers.pop(car).unregister()
                for _ in range(self._there.pop(car, 0)):
                    self._mailbox.left(car)
            self._spoke.clear()
            self._met.clear()
            for car in remote:
                if car not in self._subscribers:
                    self._subscribers[car] = self._rospy.Subscriber(
                        COMMANDS.format(car), load().Twist, partial(self._heard, car), tcp_nodelay=True
                    )

    @contextmanager
    def _guarded(self) -> Generator[None]:
        """Take failures of the graph for its loss."""
        try:
            yield
        except (self._rospy.ROSException, XmlRpcError, OSError) as error:
            if not self._lost:
                self._lose(f"the ROS graph failed: {error}")

    def _lose(self, detail: str) -> None:
        """End all that is under way."""
        self._lost = True
        self._mailbox.stop(End.TRANSPORT_LOST, detail)
        abandon(self._rospy, detail)

    def _displaced(self, reason: str) -> None:
        """End all that is under way: the master has told this node to go, since another has taken its name."""
        if self._open and not self._lost:
            self._lost = True
            self._mailbox.stop(End.TRANSPORT_LOST, f"the ROS master has shut this node down: {reason}")

    def _publish(self, view: View, *, frame: bool) -> None:
        self._stamps.see(view)
        if self._world is not None and not self._lost:
            with self._guarded():
                self._world.publish(view, self._stamps.now(), self._stamps.simulated, frame=frame)

    def _heard(self, car: str, message: Any) -> None:
        self._spoke.add(car)
        self._mailbox.command(car, message.linear.x, message.angular.z)


def connections(subscriber: Any) -> int:
    """Return how many publishers are connected to a subscriber now, whatever rospy has noticed by now.

    rospy keeps a lost connection, without a socket, to try again; and the system knows that a process has ended before
    rospy's threads have run.
    """
    implementation = subscriber.impl
    if implementation is None:
        return 0
    sockets = [connection.socket for connection in list(implementation.connections)]
    return sum(each is not None and _is_up(each.fileno()) for each in sockets)


def _is_up(descriptor: int) -> bool:
    """Tell whether the other end of a socket has not hung up; -1 is a socket that is closed."""
    if descriptor < 0:
        return False
    asked = select.poll()
    asked.register(descriptor, select.POLLRDHUP)
    return not asked.poll(0)
