#!/usr/bin/env python3
"""An ego controller over ROS 2's topics, by DDS: round the goals in order, straight across country.

It needs this package with the extra `ros2`, and no ROS 2: `Graph` and the messages are of the package; `node.py`
does the same with `rclpy`. Start it beside ``dubins-traffic ros2 run demo --lockstep``; it drives trial after trial
until it is interrupted.
"""

import json
import math
import time

from dubins_traffic.transports.ros2 import messages as m
from dubins_traffic.transports.ros2.graph import Graph, usual_domain

SPEED, YAW_RATE, TOLERANCE = 0.5, 0.9, 0.1


class Controller:
    """Answers each message of the ego's odometry with one command."""

    def __init__(self):
        self.goals, self.radius, self.next, self.asked = [], 1.0, 0, 0
        self.graph = Graph(usual_domain(), node="controller")
        self.commands = self.graph.writer("rt/ego/mobile_base/commands/velocity", m.Twist)
        maestro = "rt/dubins_traffic_maestro"
        self.asks = self.graph.writer(f"{maestro}/ask", m.String)
        self.readers = [
            (self.graph.reader(topic, kind, latched=latched), kind, take)
            for topic, kind, take, latched in (
                (f"{maestro}/probleminstance_JSON", m.String, self.begin, True),
                (f"{maestro}/answer", m.String, self.answered, False),
                ("rt/ego/odom", m.Odometry, self.drive, False),
            )
        ]

    def begin(self, message):
        """Learn the goals, or that the trial is over."""
        self.goals, self.next = [], 0
        if message.data:
            problem = json.loads(message.data)
            length, (tx, ty, theta) = problem["rnd"]["length"], problem["rnd"]["transform"]
            c, s = math.cos(theta), math.sin(theta)
            self.radius = problem["intersection_radius"]
            self.goals = [(length * (c * x - s * y) + tx, length * (s * x + c * y) + ty) for x, y in problem["goals"]]

    def answered(self, message):
        """Start the trial that is ready."""
        if message.data == "READY granted":
            self.ask("START")

    def drive(self, message):
        """Turn toward the next goal, then drive to it."""
        if not self.goals:
            return
        pose = message.pose.pose
        gx, gy = self.goals[self.next % len(self.goals)]
        dx, dy = gx - pose.position.x, gy - pose.position.y
        if math.hypot(dx, dy) < self.radius / 2:
            self.next += 1
        heading = 2.0 * math.atan2(pose.orientation.z, pose.orientation.w)
        error = math.remainder(math.atan2(dy, dx) - heading, 2.0 * math.pi)
        command = m.Twist()
        if abs(error) > TOLERANCE:
            command.angular.z = math.copysign(YAW_RATE, error)
        else:
            command.linear.x = SPEED
        self.commands.write(command)

    def ask(self, mode):
        """Ask the maestro for something."""
        self.asks.write(m.String(mode))

    def spin(self):
        """Take messages as they come, and ask for a trial while there is none."""
        while True:
            self.graph.wait(0.1)
            for reader, kind, take in self.readers:
                for message in self.graph.take(reader, kind, 100):
                    take(message)
            if not self.goals and time.monotonic() > self.asked + 0.3:
                self.asked = time.monotonic()
                self.ask("READY")


if __name__ == "__main__":
    controller = Controller()
    try:
        controller.spin()
    except KeyboardInterrupt:
        print("interrupted")
    finally:
        controller.graph.close()
