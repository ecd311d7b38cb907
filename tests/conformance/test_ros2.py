from typing import Any

import pytest

pytest.importorskip("cyclonedds")

from dubins_traffic.sessions.plan import rehearse
from dubins_traffic.transports.ros2 import messages as m
from dubins_traffic.transports.ros2.graph import Graph
from dubins_traffic.transports.ros2.transport import Ros2
from tests.conformance.ros_peer import Odometry, RosConformance, RosPeer
from tests.ports import kept_domain
from tests.recordings import make_instance


@pytest.fixture(scope="module", autouse=True)
def _compiled() -> None:
    """Compile what a trial needs before anyone waits for one."""
    rehearse(make_instance(names=("agent0",)))


class Ros2Peer(RosPeer):
    """Shares the session's DDS domain object, of which a process has one."""

    def open(self) -> None:
        self.graph = Graph(self.transport.domain, here=False)
        self.odometry = self.graph.reader("rt/ego/odom", m.Odometry)
        topic = "rt/dubins_traffic_maestro/probleminstance_JSON"
        self.problems = self.graph.reader(topic, m.String, latched=True)
        self.commands = self.graph.writer(f"rt/{self.car}/mobile_base/commands/velocity", m.Twist)

    def shut(self) -> None:
        self.graph.close()
        del self.odometry, self.problems, self.commands

    def heard(self) -> bool:
        return self.graph.heard(self.commands)

    def put(self, speed: float, yaw_rate: float) -> None:
        self.graph.put(self.commands, m.Twist(m.Vector3(speed), m.Vector3(z=yaw_rate)))

    def fetch(self) -> str | Odometry | None:
        for seen in self.graph.take(self.odometry, m.Odometry, 1):
            stamp, position = seen.header.stamp, seen.pose.pose.position
            return stamp.sec + 1e-9 * stamp.nanosec, position.x, position.y
        for told in self.graph.take(self.problems, m.String, 1):
            return told.data
        self.graph.wait(0.05)
        return None


class TestRos2(RosConformance):
    def make(self) -> Ros2:
        return Ros2(kept_domain(), clock=True)

    def connect(self, transport: Ros2, car: str) -> Any:
        return Ros2Peer(transport, car)
