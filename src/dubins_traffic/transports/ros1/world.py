"""What Gazebo, the Kobukis and the monitor of 2016 published: poses, odometry, transforms, scans, labels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from dubins_traffic.cars.state import State
from dubins_traffic.observations.senses import Senses
from dubins_traffic.problem.parts import Laser
from dubins_traffic.protocols import View
from dubins_traffic.transports.labels import Caption
from dubins_traffic.transports.ros import half
from dubins_traffic.transports.ros1.messages import load

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

QUEUE = 100
"""Messages that a slow subscriber may be behind before it misses the oldest."""
ODOMETRY = 0.025
"""Seconds between two odometries while frames are farther apart, at least."""
BASE = 0.0102
"""Height of a Kobuki's base above its footprint, metres."""
PER_CAR = ("/odom", "/scan")
NOISE = 0.01
"""Diagonal of the covariance that odometry states, for programs that want one."""


@dataclass(slots=True)
class _Car:
    """Publishers and messages of one car; messages are filled in again and again."""

    odometry: Any
    scan: Any
    odom_message: Any
    scan_message: Any
    transforms: tuple[Any, ...]
    senses: Senses
    swept: int = -1


class Topics:
    """The publishers of a session, each made once: who listens stays connected from trial to trial."""

    def __init__(self, rospy: Any) -> None:
        self.rospy = rospy
        self._made: dict[str, Any] = {}

    def publisher(self, topic: str, kind: Any, *, latch: bool = False) -> Any:
        """Return the publisher of `topic`."""
        if topic not in self._made:
            self._made[topic] = self.rospy.Publisher(topic, kind, queue_size=QUEUE, latch=latch, tcp_nodelay=True)
        return self._made[topic]

    def retain(self, cars: Sequence[str]) -> None:
        """Take back the topics of cars that are not among `cars`."""
        for topic in [topic for topic in self._made if topic.endswith(PER_CAR)]:
            if topic.split("/")[1] not in cars:
                self._made.pop(topic).unregister()

    def close(self) -> None:
        """Take all topics back."""
        while self._made:
            self._made.popitem()[1].unregister()


class Ros1Publishers:
    """Publishes the cars of one instance; only what someone listens to is made.

    Parameters
    ----------
    topics : Topics
        Has the publishers, which outlive the instance.
    clock : bool
        Whether `/clock` is published.
    simulated : bool
        Whether the cars are simulated here; else only labels are published.
    """

    def __init__(self, topics: Topics, instance: Instance, *, clock: bool, simulated: bool = True) -> None:
        self._m = load()
        self._rospy = topics.rospy
        self._publisher = topics.publisher
        self._names = instance.names
        self._caption = Caption(instance.problem.network, instance.names)
        self._label_message = self._m.LabelStamped()
        self._label_message.header.frame_id = "map"
        self._labels = self._publisher("/loutput", self._m.LabelStamped, latch=True)
        self._simulated = simulated
        if not simulated:
            return
        self._models = self._publisher("/gazebo/model_states", self._m.ModelStates)
        self._transforms = self._publisher("/tf", self._m.TFMessage)
        self._clock = self._publisher("/clock", self._m.Clock) if clock else None
        self._states = self._model_states()
        self._cars = [self._car(instance, n, name) for n, name in enumerate(instance.names)]
        self._odometry_at = -1.0

    def publish(self, view: View, stamp: float, simulated: float, *, frame: bool) -> None:
        """Publish `view`, stamped so (seconds); poses last. `frame`: it is a frame, and everything is sent.

        Lasers sweep by the time `simulated`, so that who drives in lockstep gets the sweeps of real time.
        """
        time = self._rospy.Time.from_sec(stamp)
        if not self._simulated:
            self._put_labels(view, time)
            return
        if self._clock is not None:
            self._clock.publish(time)
        self._put_labels(view, time)
        if frame or stamp - self._odometry_at >= ODOMETRY:
            self._odometry_at = stamp
            self._put_odometry(view, time)
        for car in self._cars:
            self._put_scan(car, view, simulated, time)
        if self._models.get_num_connections():
            self._fill_states(view.state)
            self._models.publish(self._states)

    def _model_states(self) -> Any:
        m = self._m
        count = len(self._names)
        return m.ModelStates(list(self._names), [m.Pose() for _ in range(count)], [m.Twist() for _ in range(count)])

    def _car(self, instance: Instance, n: int, name: str) -> _Car:
        m = self._m
        odometry = m.Odometry()
        odometry.header.frame_id, odometry.child_frame_id = f"{name}/odom", f"{name}/base_footprint"
        for k in range(0, 36, 7):
            odometry.pose.covariance[k] = odometry.twist.covariance[k] = NOISE
        laser = instance.problem.laser or Laser()
        step = (laser.angle_max - laser.angle_min) / max(1, laser.rays - 1)
        scan = m.LaserScan(
            angle_min=laser.angle_min, angle_max=laser.angle_max, angle_increment=step, scan_time=1.0 / laser.rate,
            range_min=laser.range_min, range_max=laser.range_max,
        )  # fmt: skip
        scan.header.frame_id = f"{name}/base_link"
        return _Car(
            self._publisher(f"/{name}/odom", m.Odometry),
            self._publisher(f"/{name}/scan", m.LaserScan),
            odometry,
            scan,
            (
                self._transform("map", f"{name}/odom"),
                self._transform(f"{name}/odom", f"{name}/base_footprint"),
                self._transform(f"{name}/base_footprint", f"{name}/base_link", BASE),
            ),
            Senses(instance, n, laser=laser),
        )

    def _transform(self, parent: str, child: str, height: float = 0.0) -> Any:
        m = self._m
        transform = m.TransformStamped(child_frame_id=child)
        transform.header.frame_id = parent
        transform.transform.translation.z = height
        transform.transform.rotation.w = 1.0
        return transform

    def _put_labels(self, view: View, time: Any) -> None:
        message = self._label_message
        message.header.stamp = time
        if self._caption.update(view.labels):
            message.label = self._caption.words
        self._labels.publish(message)

    def _put_odometry(self, view: View, time: Any) -> None:
        listens = self._transforms.get_num_connections() > 0
        for n, car in enumerate(self._cars):
            if not listens and not car.odometry.get_num_connections():
                continue
            seen = view.observe(n) if n == 0 else None
            pose = seen.pose if seen is not None else tuple(float(row[0, n]) for row in view.state[:4])
            message = car.odom_message
            message.header.stamp = time
            _put_pose(message.pose.pose, *pose)
            message.twist.twist.linear.x = float(view.state.speed[0, n])
            message.twist.twist.angular.z = float(view.state.yaw_rate[0, n])
            car.odometry.publish(message)
            moved = car.transforms[1].transform
            moved.translation.x, moved.translation.y = pose[0], pose[1]
            moved.rotation = message.pose.pose.orientation
        if listens:
            every = [transform for car in self._cars for transform in car.transforms]
            for transform in every:
                transform.header.stamp = time
            self._transforms.publish(every)

    def _put_scan(self, car: _Car, view: View, simulated: float, time: Any) -> None:
        """Publish a scan when the laser's next sweep is due, if someone listens."""
        sweep = int(simulated / car.scan_message.scan_time + 1e-6)
        if sweep == car.swept or not car.scan.get_num_connections():
            return
        car.swept = sweep
        ranges = car.senses.sweep(view.state)
        message = car.scan_message
        message.header.stamp = time
        message.ranges = ranges.tolist()
        car.scan.publish(message)

    def _fill_states(self, state: State) -> None:
        x, y, c, s = (row[0].tolist() for row in state[:4])
        speed, yaw_rate = state.speed[0].tolist(), state.yaw_rate[0].tolist()
        for n, (pose, twist) in enumerate(zip(self._states.pose, self._states.twist, strict=True)):
            _put_pose(pose, x[n], y[n], c[n], s[n])
            twist.linear.x, twist.linear.y = speed[n] * c[n], speed[n] * s[n]
            twist.angular.z = yaw_rate[n]


def _put_pose(message: Any, x: float, y: float, c: float, s: float) -> None:
    """Fill in a pose whose heading is the unit vector (c, s)."""
    message.position.x, message.position.y = x, y
    z, w = half(c, s)
    message.orientation.z, message.orientation.w = z, w
