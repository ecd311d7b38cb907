"""The maestro's client and the ego's driver over ROS 2's topics; as a program: DOMAIN ACTION."""

import math
import os
import signal
import sys
import time

from dubins_traffic.transports.ros2 import messages as m
from dubins_traffic.transports.ros2.graph import Graph

READY, START, RESET, RESTART = "READY", "START", "RESET", "RESTART"
SIGNALS = {"die": signal.SIGKILL, "stop": signal.SIGSTOP}


def law(x: float, y: float) -> tuple[float, float]:
    return 0.25 + 0.01 * x, 0.3 * y


class Client:
    """The maestro's client and the ego's driver, from names and types alone."""

    def __init__(self, domain: int) -> None:
        self.graph = Graph(domain)
        maestro = "dubins_traffic_maestro"
        self.asks = self.graph.writer(f"rt/{maestro}/ask", m.String)
        self.answers = self.graph.reader(f"rt/{maestro}/answer", m.String)
        topic = f"rt/{maestro}/probleminstance_JSON"
        self.instances = self.graph.reader(topic, m.String, latched=True)
        self.labels = self.graph.reader("rt/loutput", m.String)
        self.scans = self.graph.reader("rt/agent0/scan", m.LaserScan)
        self.odometry = self.graph.reader("rt/ego/odom", m.Odometry)
        self.commands = self.graph.writer("rt/ego/mobile_base/commands/velocity", m.Twist)
        self.places = self.graph.writer("rt/ego/place", m.PoseStamped)
        self.seen: set[str] = set()

    def ask(self, mode: str) -> bool | None:
        """Return what the maestro says; None if it says nothing within a second, and READY can be asked again."""
        self.graph.take(self.answers, m.String, 100)
        self.asks.write(m.String(mode))
        until = time.monotonic() + (1.0 if mode == READY else 600.0)
        while time.monotonic() < until:
            for reply in self.graph.take(self.answers, m.String, 10):
                if reply.data.startswith(f"{mode} "):
                    return reply.data == f"{mode} granted"
            self.graph.wait(0.05)
        return None

    def until(self, mode: str) -> None:
        """Ask until it is granted."""
        end = time.monotonic() + 600
        while not ((mode != START or self.ask(READY)) and self.ask(mode)):
            assert time.monotonic() < end

    def instance(self) -> str:
        """Wait for the next problem, or for the empty one that ends a trial."""
        end = time.monotonic() + 600
        while time.monotonic() < end:
            for message in self.graph.take(self.instances, m.String, 1):
                return message.data
            self.graph.wait(0.05)
        raise AssertionError("no instance")

    def problem(self) -> str:
        """Wait for the next problem; that no trial runs, the last one's end, is told as well to who comes late."""
        return self.instance() or self.instance()

    def drive(self, most: int | None = None) -> int:
        """Answer frames until the trial is over, or some; return how many."""
        answered, last = 0, time.monotonic()
        while most is None or answered < most:
            for seen in self.graph.take(self.odometry, m.Odometry, 100):
                position = seen.pose.pose.position
                speed, yaw_rate = law(position.x, position.y)
                self.commands.write(m.Twist(m.Vector3(speed), m.Vector3(z=yaw_rate)))
                answered, last = answered + 1, time.monotonic()
            for message in self.graph.take(self.labels, m.String, 10):
                self.seen |= set(message.data.split())
            if self.graph.take(self.instances, m.String, 1):
                return answered
            assert time.monotonic() - last < 600
            self.graph.wait(0.01)
        return answered

    def place(self, x: float, y: float) -> None:
        """Put the ego elsewhere until it is seen there."""
        pose = m.Pose(m.Point(x, y))
        end = time.monotonic() + 600
        while (x, y) != self.watch(0.1)[-1]:
            self.places.write(m.PoseStamped(pose=pose))
            assert time.monotonic() < end

    def watch(self, seconds: float, times: int = 1) -> list[tuple[float, float]]:
        """Return where the ego is seen in so many seconds, and until it has been seen so many times."""
        seen: list[tuple[float, float]] = []
        end = time.monotonic() + seconds
        while time.monotonic() < end or len(seen) < times:
            assert time.monotonic() < end + 600
            for message in self.graph.take(self.odometry, m.Odometry, 100):
                position = message.pose.pose.position
                seen.append((position.x, position.y))
            self.graph.wait(0.01)
        return seen

    def go(self, action: str) -> None:
        """Drive a little, then do something else: die, stop, flood, nan, reset."""
        self.until(START)
        self.problem()
        self.drive(20)
        if action == "reset":
            self.until(RESET)
        elif action in SIGNALS:
            os.kill(os.getpid(), SIGNALS[action])
        elif action == "nan":
            self.commands.write(m.Twist(m.Vector3(math.nan)))
            time.sleep(20)
        else:
            until = time.monotonic() + 600
            while time.monotonic() < until:
                for _ in range(10):
                    self.commands.write(m.Twist())
                time.sleep(0.001)


if __name__ == "__main__":
    Client(int(sys.argv[1])).go(sys.argv[2])
