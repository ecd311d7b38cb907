"""What a session publishes of its cars over ROS 2: model states, odometry, scans, labels."""

from __future__ import annotations

from math import floor
from typing import TYPE_CHECKING, Any

from dubins_traffic.cars.state import State
from dubins_traffic.driving.senses import Senses
from dubins_traffic.problem.instance import Laser
from dubins_traffic.protocols import View
from dubins_traffic.spec.labels import words
from dubins_traffic.transports.ros1.world import half
from dubins_traffic.transports.ros2 import messages as m
from dubins_traffic.transports.ros2.graph import Graph

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

MODEL_STATES = "rt/gazebo/model_states"
LABELS = "rt/loutput"


class World:
    """Publishes the cars of one instance; the writers outlive it, so that who listens stays matched."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._writers: dict[str, Any] = {}

    def begin(self, instance: Instance) -> None:
        """Take the cars of `instance`."""
        self._names = instance.names
        self._network = instance.problem.network
        self._laser = instance.problem.laser or Laser()
        self._senses = [Senses(instance, n, laser=self._laser) for n in range(len(instance.names))]
        self._swept = -1

    def publish(self, view: View, stamp: m.Time) -> None:
        """Publish `view`; the model states come last."""
        label = list(words(self._network, self._names, view.labels.segment[0], view.labels.at[0]))
        self._put(LABELS, m.LabelStamped(m.Header(stamp, "map"), label), latched=True)
        poses, twists = _poses(view.state, len(self._names)), _twists(view.state, len(self._names))
        sweep = floor(view.time * self._laser.rate + 1e-6)
        for n, name in enumerate(self._names):
            self._put(f"rt/{name}/odom", self._odometry(view, n, poses[n], stamp))
            if sweep != self._swept:
                self._put(f"rt/{name}/scan", self._scan(view, n, stamp))
        self._swept = sweep
        self._put(MODEL_STATES, m.ModelStates(list(self._names), poses, twists))

    def _put(self, topic: str, message: Any, *, latched: bool = False) -> None:
        if topic not in self._writers:
            self._writers[topic] = self._graph.writer(topic, type(message), latched=latched)
        self._graph.put(self._writers[topic], message)

    def _odometry(self, view: View, n: int, pose: m.Pose, stamp: m.Time) -> m.Odometry:
        name = self._names[n]
        if n == 0:
            x, y, c, s = view.observe(0).pose
            pose = _pose(x, y, c, s)
        message = m.Odometry(m.Header(stamp, f"{name}/odom"), f"{name}/base_footprint")
        message.pose.pose = pose
        message.twist.twist.linear.x = float(view.state.speed[0, n])
        message.twist.twist.angular.z = float(view.state.yaw_rate[0, n])
        return message

    def _scan(self, view: View, n: int, stamp: m.Time) -> m.LaserScan:
        laser = self._laser
        return m.LaserScan(
            m.Header(stamp, f"{self._names[n]}/base_link"),
            angle_min=laser.angle_min,
            angle_max=laser.angle_max,
            angle_increment=(laser.angle_max - laser.angle_min) / max(1, laser.rays - 1),
            scan_time=1.0 / laser.rate,
            range_min=laser.range_min,
            range_max=laser.range_max,
            ranges=self._senses[n].sweep(view.state).tolist(),
        )


def _poses(state: State, count: int) -> list[m.Pose]:
    columns = [row[0, :count].tolist() for row in state[:4]]
    return [_pose(*values) for values in zip(*columns, strict=True)]


def _pose(x: float, y: float, c: float, s: float) -> m.Pose:
    z, w = half(c, s)
    return m.Pose(m.Point(x, y), m.Quaternion(0.0, 0.0, z, w))


def _twists(state: State, count: int) -> list[m.Twist]:
    """Return velocities in the world frame, as Gazebo gave them."""
    columns = [row[0, :count].tolist() for row in (state.c, state.s, state.speed, state.yaw_rate)]
    return [
        m.Twist(m.Vector3(speed * c, speed * s), m.Vector3(z=yaw_rate))
        for c, s, speed, yaw_rate in zip(*columns, strict=True)
    ]
