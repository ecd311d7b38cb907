"""What the maestro of 2016 served: parameters, the mode service, the problem instance, pausing, placing cars."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from dubins_traffic.cars.body import Rectangle
from dubins_traffic.problem.document import instance_to_document
from dubins_traffic.protocols import Mailbox
from dubins_traffic.transports.foreign import ForeignMaestro
from dubins_traffic.transports.maestro import Maestro, Mode
from dubins_traffic.transports.quaternion import placed
from dubins_traffic.transports.ros1.messages import load
from dubins_traffic.transports.ros1.node import NAME

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
    rospy : module
        With this process a node.
    mailbox : Mailbox
        Where requests go.
    maestro : Maestro, optional
        Who answers mode requests; without one there is no mode service.
    parameters : SessionParameters
        The session, for parameters.
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
                PROBLEM, m.ProblemInstanceJSON, queue_size=1, latch=True, tcp_nodelay=True
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
            self._placing = rospy.Subscriber(
                "/gazebo/set_model_state", m.ModelState, self._place, queue_size=10
            )
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
        position, turn = message.pose.position, message.pose.orientation
        pose = placed(position.x, position.y, turn.z, turn.w)
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
