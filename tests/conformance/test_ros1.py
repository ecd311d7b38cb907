import gc
import queue
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from dubins_traffic.protocols import End, Mailbox
from dubins_traffic.sessions.plan import rehearse
from dubins_traffic.transports.clocks import Lockstep, RealTime
from dubins_traffic.transports.ros1.master import Master
from dubins_traffic.transports.ros1.messages import load
from dubins_traffic.transports.ros1.node import leave
from dubins_traffic.transports.ros1.transport import Ros1
from tests.conformance.ros_peer import Odometry, RosConformance, RosPeer
from tests.conformance.transport import SOON, answer
from tests.recordings import make_instance
from tests.ros import need_ros

pytestmark = [
    pytest.mark.tools,
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),  # rospy leaves sockets to the collector
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]


@pytest.fixture(scope="module", autouse=True)
def uri(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A master of this module's own; this process is a node there, session and peer in one."""
    need_ros()
    rehearse(make_instance(names=("agent0",)))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_IP", "127.0.0.1")
        patch.setenv("ROS_LOG_DIR", str(tmp_path_factory.mktemp("log")))
        master = Master(0)
        patch.setenv("ROS_MASTER_URI", master.uri)
        try:
            yield master.uri
        finally:
            leave()
            master.close()
            gc.collect()


class Ros1Peer(RosPeer):
    def open(self) -> None:
        self.rospy = self.transport.rospy
        m, self.came = load(), queue.SimpleQueue[str | Odometry]()
        topics = (
            ("/ego/odom", m.Odometry, self.move),
            ("/dubins_traffic_maestro/probleminstance_JSON", m.ProblemInstanceJSON, self.learn),
        )
        self.ears = [self.rospy.Subscriber(topic, kind, take, tcp_nodelay=True) for topic, kind, take in topics]
        topic = f"/{self.car}/mobile_base/commands/velocity"
        self.commands = self.rospy.Publisher(topic, m.Twist, queue_size=100, tcp_nodelay=True)

    def shut(self) -> None:
        for each in (*self.ears, self.commands):
            each.unregister()

    def move(self, message: Any) -> None:
        position = message.pose.pose.position
        self.came.put((message.header.stamp.to_sec(), position.x, position.y))

    def learn(self, message: Any) -> None:
        self.came.put(message.problemjson)

    def heard(self) -> bool:
        return self.commands.get_num_connections() > 0

    @contextmanager
    def slow_to_hear(self) -> Iterator[None]:
        """Hold back what rospy's thread writes to this peer's socket."""
        (queued,) = self.transport._services._problem.impl.connections
        socket, go = queued._connection, threading.Event()
        write = socket.write_data
        socket.write_data = lambda data: go.wait() and write(data)
        yield
        go.set()

    def put(self, speed: float, yaw_rate: float) -> None:
        twist = load().Twist()
        twist.linear.x, twist.angular.z = speed, yaw_rate
        self.commands.publish(twist)

    def fetch(self) -> str | Odometry | None:
        try:
            return self.came.get(timeout=0.05)
        except queue.Empty:
            return None


class TestRos1(RosConformance):
    @pytest.fixture(autouse=True)
    def _at(self, uri: str) -> None:
        self.uri = uri

    def make(self) -> Ros1:
        return Ros1(self.uri, clock=True)

    def connect(self, transport: Ros1, car: str) -> Ros1Peer:
        return Ros1Peer(transport, car)

    @pytest.mark.parametrize("clock", [Lockstep(SOON), RealTime(2.0)], ids=["lockstep", "real time"])
    def test_a_peer_that_dies_before_anyone_has_looked_is_lost(self, clock: Any) -> None:
        self.ticks = 1200
        self.make = lambda: Unwatched(self.uri, clock=True)
        self.connect = Unseen
        result = self.run(answer(until=5, then=lambda peer: peer.hang_up()), clock)
        assert result.ending.end is End.PEER_LOST


class Unseen(Ros1Peer):
    """Nobody looks for it."""

    def await_seen(self, there: bool) -> None:
        """Don't wait."""


class Unwatched(Ros1):
    """As on a busy machine: who is there is looked at only when a peer does not answer."""

    def open(self, mailbox: Mailbox) -> None:
        super().open(mailbox)
        self._watch.close()
