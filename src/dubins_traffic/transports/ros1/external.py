"""The wire to a world outside over ROS 1 (`transports.external`)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from time import sleep
from typing import Any

from dubins_traffic.cars.state import Pose
from dubins_traffic.transports.ros import placed
from dubins_traffic.transports.ros1.messages import load
from dubins_traffic.transports.ros1.transport import COMMANDS

STATES = "/gazebo/model_states"


class Ros1Wire:
    """Takes poses from topics of ROS 1, in its threads, and publishes velocities.

    Parameters
    ----------
    poses : str, optional
        A topic of geometry_msgs/PoseStamped for each car, ``{}`` in place of its name, as trackers publish; by default
        all cars are in `/gazebo/model_states`.
    """

    def __init__(self, rospy: Any, poses: str | None) -> None:
        self._rospy, self._poses = rospy, poses
        self._subscribers: list[Any] = []
        self._publishers: dict[str, Any] = {}

    def listen(self, names: Sequence[str], note: Callable[[str, Pose], None]) -> str:
        """Subscribe to the poses of the cars `names`."""
        m = load()
        self._note = note
        if self._poses is None:
            self._subscribe(STATES, m.ModelStates, self._take)
            return STATES
        for name in names:
            self._subscribe(self._poses.format(name), m.PoseStamped, partial(self._take_pose, name))
        return self._poses

    def send(self, name: str, speed: float, yaw_rate: float) -> None:
        """Publish a velocity."""
        m = load()
        if name not in self._publishers:
            topic = COMMANDS.format(name)
            self._publishers[name] = self._rospy.Publisher(topic, m.Twist, queue_size=1, tcp_nodelay=True)
        twist = m.Twist()
        twist.linear.x, twist.angular.z = speed, yaw_rate
        self._publishers[name].publish(twist)

    def wait(self, seconds: float) -> None:
        """Wait; poses are noted meanwhile."""
        sleep(seconds)

    def _subscribe(self, topic: str, kind: Any, take: Callable[..., None]) -> None:
        self._subscribers.append(self._rospy.Subscriber(topic, kind, take, tcp_nodelay=True))

    def _take(self, message: Any) -> None:
        for name, pose in zip(message.name, message.pose, strict=True):
            self._take_one(name, pose)

    def _take_pose(self, name: str, message: Any) -> None:
        self._take_one(name, message.pose)

    def _take_one(self, name: str, told: Any) -> None:
        pose = placed(told)
        if pose is not None:
            self._note(name, pose)
