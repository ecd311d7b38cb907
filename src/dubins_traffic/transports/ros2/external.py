"""The wire to a world outside over ROS 2 (`transports.external`)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import monotonic, sleep
from typing import Any

from dubins_traffic.cars.state import Pose
from dubins_traffic.transports.ros import placed
from dubins_traffic.transports.ros2 import messages as m
from dubins_traffic.transports.ros2.graph import Graph
from dubins_traffic.transports.ros2.transport import AT_ONCE, COMMANDS

POSES = "/{}/pose"
"""Where trackers publish the pose of each car by default."""
LOOK = 0.002
"""Seconds between two looks for poses."""


class Ros2Wire:
    """Takes poses from topics of ROS 2 while it is waited, and publishes velocities.

    Parameters
    ----------
    poses : str, optional
        A topic of geometry_msgs/PoseStamped for each car, ``{}`` in place of its name; ``/{}/pose`` by default.
    """

    def __init__(self, graph: Graph, poses: str | None) -> None:
        self._graph, self._poses = graph, POSES if poses is None else poses
        self._readers: dict[str, Any] = {}
        self._writers: dict[str, Any] = {}

    def listen(self, names: Sequence[str], note: Callable[[str, Pose], None]) -> str:
        """Read the poses of the cars `names`."""
        self._note = note
        for name in names:
            topic = f"rt/{self._poses.format(name).lstrip('/')}"
            self._readers[name] = self._graph.reader(topic, m.PoseStamped, lossy=True)
        return self._poses

    def send(self, name: str, speed: float, yaw_rate: float) -> None:
        """Write a velocity."""
        if name not in self._writers:
            self._writers[name] = self._graph.writer(COMMANDS.format(name), m.Twist)
        self._graph.put(self._writers[name], m.Twist(m.Vector3(speed), m.Vector3(z=yaw_rate)))

    def wait(self, seconds: float) -> None:
        """Wait, and note the poses that come meanwhile."""
        until = monotonic() + seconds
        while True:
            for name, reader in self._readers.items():
                for message in self._graph.take(reader, m.PoseStamped, AT_ONCE):
                    pose = placed(message.pose)
                    if pose is not None:
                        self._note(name, pose)
            left = until - monotonic()
            if left <= 0.0:
                return
            sleep(min(left, LOOK))
