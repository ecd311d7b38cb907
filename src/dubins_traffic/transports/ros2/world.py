"""What a session publishes of its cars over ROS 2: odometry, transforms, scans, labels, time, markers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import floor
from typing import TYPE_CHECKING, Any

from dubins_traffic.observations.senses import Senses
from dubins_traffic.problem.parts import Laser
from dubins_traffic.protocols import View
from dubins_traffic.transports import marks
from dubins_traffic.transports.labels import Caption
from dubins_traffic.transports.ros import half
from dubins_traffic.transports.ros1.world import BASE
from dubins_traffic.transports.ros2 import messages as m
from dubins_traffic.transports.ros2.graph import Graph

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

LABELS = "rt/loutput"
CLOCK = "rt/clock"
TRANSFORMS = "rt/tf"


class Ros2Publishers:
    """Publishes the cars of one instance; only what someone listens to is made.

    The writers outlive an instance, so that who listens stays matched.

    Parameters
    ----------
    clock : bool
        Whether `/clock` is published.
    simulated : bool
        Whether the cars are simulated here; else only labels and markers are published.
    markers : bool
        Whether markers for RViz are published.
    """

    def __init__(self, graph: Graph, *, clock: bool, simulated: bool, markers: bool = False) -> None:
        self._graph, self._clock, self._simulated, self._markers = graph, clock, simulated, markers
        self._writers: dict[str, Any] = {}

    def begin(self, instance: Instance) -> None:
        """Take the cars of `instance`."""
        self._names = instance.names
        self._caption = Caption(instance.problem.network, instance.names)
        self._laser = instance.problem.laser or Laser()
        self._senses = [Senses(instance, n, laser=self._laser) for n in range(len(instance.names))]
        self._swept = -1
        self._problem, self._is_new = instance.problem, True

    def publish(self, view: View, stamp: float, simulated: float) -> None:
        """Publish `view`, stamped so (seconds); the ego's odometry comes last.

        Lasers sweep by the time `simulated`.
        """
        time = moment(stamp)
        if self._clock:
            self._put(CLOCK, m.Clock, lambda: m.Clock(time))
        self._caption.update(view.labels)
        self._put(LABELS, m.String, lambda: m.String(" ".join(self._caption.words)), latched=True)
        if self._markers:
            self._put_marks(view, time)
        if not self._simulated:
            return
        sweep = floor(simulated * self._laser.rate + 1e-6)
        if sweep != self._swept:
            self._swept = sweep
            for n, name in enumerate(self._names):
                self._put(f"rt/{name}/scan", m.LaserScan, lambda n=n: self._scan(view, n, time))
        self._put(TRANSFORMS, m.TFMessage, lambda: self._transforms(view, time))
        for n in reversed(range(len(self._names))):
            self._put(f"rt/{self._names[n]}/odom", m.Odometry, lambda n=n: self._odometry(view, n, time))

    def _put_marks(self, view: View, time: m.Time) -> None:
        """Put markers of the cars, and of their world when it is new: all of the one before go first."""
        if self._is_new:
            world = marks.of_world(self._problem)
            self._put(f"rt{marks.ROADS}", m.MarkerArray, lambda: _shown(world, time, True), latched=True)
        is_new, self._is_new = self._is_new, False
        self._put(f"rt{marks.CARS}", m.MarkerArray, lambda: _shown(self._cars(view), time, is_new))

    def _cars(self, view: View) -> list[marks.Mark]:
        body = self._problem.car.body
        poses = [tuple(float(row[0, n]) for row in view.state[:4]) for n in range(len(self._names))]
        return [mark for n, (x, y, c, s) in enumerate(poses) for mark in marks.of_car(n, body, x, y, half(c, s))]

    def _put(self, topic: str, kind: Any, make: Callable[[], Any], *, latched: bool = False) -> None:
        if topic not in self._writers:
            self._writers[topic] = self._graph.writer(topic, kind, latched=latched)
        writer = self._writers[topic]
        if latched or self._graph.heard(writer):
            self._graph.put(writer, make())

    def _odometry(self, view: View, n: int, stamp: m.Time) -> m.Odometry:
        name = self._names[n]
        message = m.Odometry(m.Header(stamp, f"{name}/odom"), f"{name}/base_footprint")
        message.pose.pose = _odometric(view, n)
        message.twist.twist.linear.x = float(view.state.speed[0, n])
        message.twist.twist.angular.z = float(view.state.yaw_rate[0, n])
        return message

    def _transforms(self, view: View, stamp: m.Time) -> m.TFMessage:
        """Return where each car's odometry, footprint and base lie, as a Kobuki tells it."""
        every: list[m.TransformStamped] = []
        for n, name in enumerate(self._names):
            pose = _odometric(view, n)
            moved = m.Transform(m.Vector3(pose.position.x, pose.position.y), pose.orientation)
            for parent, child, transform in (
                ("map", f"{name}/odom", m.Transform()),
                (f"{name}/odom", f"{name}/base_footprint", moved),
                (f"{name}/base_footprint", f"{name}/base_link", m.Transform(m.Vector3(z=BASE))),
            ):
                every.append(m.TransformStamped(m.Header(stamp, parent), child, transform))
        return m.TFMessage(every)

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


def _shown(shown: Sequence[marks.Mark], stamp: m.Time, is_new: bool) -> m.MarkerArray:
    """Return marks as markers; those of a new world come after one that takes away what was shown before."""
    header = m.Header(stamp, "map")
    wipe = [m.Marker(header, action=marks.DELETE_ALL)] if is_new else []
    return m.MarkerArray(wipe + [_marker(mark, header) for mark in shown])


def _marker(mark: marks.Mark, header: m.Header) -> m.Marker:
    return m.Marker(
        header, mark.group, mark.number, mark.kind, marks.ADD,
        m.Pose(m.Point(*mark.place), m.Quaternion(0.0, 0.0, *mark.turn)),
        m.Vector3(*mark.scale), m.ColorRGBA(*mark.color), m.Duration(mark.seconds),
        points=[m.Point(x, y) for x, y in mark.points], text=mark.text,
    )  # fmt: skip


def moment(seconds: float) -> m.Time:
    """Return a time in the form of ROS 2."""
    whole = floor(seconds)
    return m.Time(whole, int((seconds - whole) * 1e9))


def _odometric(view: View, n: int) -> m.Pose:
    """Return where car n believes it is; the ego's odometry has the instance's noise."""
    if n == 0:
        return _pose(*view.observe(0).pose)
    return _pose(*(float(row[0, n]) for row in view.state[:4]))


def _pose(x: float, y: float, c: float, s: float) -> m.Pose:
    z, w = half(c, s)
    return m.Pose(m.Point(x, y), m.Quaternion(0.0, 0.0, z, w))
