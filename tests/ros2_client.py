"""The maestro's client and the ego's driver over ROS 2's topics; as a program: DOMAIN ACTION."""

import itertools
import math
import os
import signal
import sys
import time

from dubins_traffic.transports.ros2 import messages as m
from dubins_traffic.transports.ros2.graph import Graph

READY, START, RESET, RESTART = 4, 5, 0, 1
SIGNALS = {"die": signal.SIGKILL, "stop": signal.SIGSTOP}


def law(x: float, y: float) -> tuple[float, float]:
    return 0.25 + 0.01 * x, 0.3 * y


class Client:
    """The maestro's client and the ego's driver, from names and types alone."""

    def __init__(self, domain: int) -> None:
        self.graph = Graph(domain)
        maestro = "dubins_traffic_maestro"
        self.requests = self.graph.writer(f"rq/{maestro}/modeRequest", m.ModeRequest)
        self.replies = self.graph.reader(f"rr/{maestro}/modeReply", m.ModeReply)
        topic = f"rt/{maestro}/probleminstance_JSON"
        self.instances = self.graph.reader(topic, m.ProblemInstanceJSON, latched=True)
        self.labels = self.graph.reader("rt/loutput", m.LabelStamped)
        self.scans = self.graph.reader("rt/agent0/scan", m.LaserScan)
        self.states = self.graph.reader("rt/gazebo/model_states", m.ModelStates)
        self.commands = self.graph.writer("rt/ego/mobile_base/commands/velocity", m.Twist)
        self.places = self.graph.writer("rt/gazebo/set_model_state", m.ModelState)
        self.number = 0
        self.seen: set[str] = set()

    def ask(self, mode: int) -> bool | None:
        """Return what the maestro says; None if it says nothing within a second, and READY can be asked again."""
        self.number += 1
        self.requests.write(m.ModeRequest(1234, self.number, mode))
        until = time.monotonic() + (1.0 if mode == READY else 600.0)
        while time.monotonic() < until:
            for reply in self.graph.take(self.replies, m.ModeReply, 10):
                if (reply.guid, reply.seq) == (1234, self.number):
                    return reply.result
            self.graph.wait(0.05)
        return None

    def until(self, mode: int) -> None:
        """Ask until it is granted."""
        end = time.monotonic() + 600
        while not ((mode != START or self.ask(READY)) and self.ask(mode)):
            assert time.monotonic() < end

    def instance(self) -> str:
        """Wait for the next problem, or for the empty one that ends a trial."""
        end = time.monotonic() + 600
        while time.monotonic() < end:
            for message in self.graph.take(self.instances, m.ProblemInstanceJSON, 1):
                return message.problemjson
            self.graph.wait(0.05)
        raise AssertionError("no instance")

    def drive(self, most: int | None = None) -> int:
        """Answer frames until the trial is over, or some; return how many."""
        answered, last = 0, time.monotonic()
        while most is None or answered < most:
            for states in self.graph.take(self.states, m.ModelStates, 100):
                position = states.pose[states.name.index("ego")].position
                speed, yaw_rate = law(position.x, position.y)
                self.commands.write(m.Twist(m.Vector3(speed), m.Vector3(z=yaw_rate)))
                answered, last = answered + 1, time.monotonic()
            for message in self.graph.take(self.labels, m.LabelStamped, 10):
                self.seen |= set(message.label)
            if self.graph.take(self.instances, m.ProblemInstanceJSON, 1):
                return answered
            assert time.monotonic() - last < 600
            self.graph.wait(0.01)
        return answered

    def call(self, service: str) -> None:
        """Call a service that takes and says nothing."""
        requests = self.graph.writer(f"rq/{service}Request", m.EmptyRequest)
        replies = self.graph.reader(f"rr/{service}Reply", m.EmptyReply)
        end = time.monotonic() + 600
        for number in itertools.count():
            requests.write(m.EmptyRequest(1234, number))
            self.graph.wait(0.2)
            if self.graph.take(replies, m.EmptyReply, 10):
                return
            assert time.monotonic() < end

    def place(self, x: float, y: float) -> None:
        """Put the ego elsewhere until it is seen there."""
        pose = m.Pose(m.Point(x, y))
        end = time.monotonic() + 600
        while (x, y) != self.watch(0.1)[-1]:
            self.places.write(m.ModelState("ego", pose))
            assert time.monotonic() < end

    def watch(self, seconds: float, times: int = 1) -> list[tuple[float, float]]:
        """Return where the ego is seen in so many seconds, and until it has been seen so many times."""
        seen: list[tuple[float, float]] = []
        end = time.monotonic() + seconds
        while time.monotonic() < end or len(seen) < times:
            assert time.monotonic() < end + 600
            for states in self.graph.take(self.states, m.ModelStates, 100):
                position = states.pose[states.name.index("ego")].position
                seen.append((position.x, position.y))
            self.graph.wait(0.01)
        return seen

    def go(self, action: str) -> None:
        """Drive a little, then do something else: die, stop, flood, nan, reset."""
        self.until(START)
        self.instance()
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
