#!/usr/bin/env python3
"""An ego controller over ROS 2's topics, by DDS: round the goals in order, straight across country.

It needs this package with the extra `ros2`, and no ROS 2: `Graph` and the messages are of the package. A node of
ROS 2 does the same with `rclpy`. Start it beside
``dubins-traffic ros2 run demo --lockstep``; it drives trial after trial until it is interrupted.
"""

import json
import math
import os
import time

from dubins_traffic.transports.ros2 import messages as m
from dubins_traffic.transports.ros2.graph import Graph, usual_domain

SPEED, YAW_RATE, TOLERANCE = 0.5, 0.9, 0.1
READY, START = 4, 5


class Controller:
    """Answers each message of model states with one command."""

    def __init__(self):
        self.goals, self.radius, self.next, self.asked = [], 1.0, 0, 0
        self.graph = Graph(usual_domain())
        self.commands = self.graph.writer("rt/ego/mobile_base/commands/velocity", m.Twist)
        self.requests = self.graph.writer("rq/dubins_traffic_maestro/modeRequest", m.ModeRequest)
        maestro = "dubins_traffic_maestro"
        self.readers = [
            (self.graph.reader(topic, kind, latched=latched), kind, take)
            for topic, kind, take, latched in (
                (f"rt/{maestro}/probleminstance_JSON", m.ProblemInstanceJSON, self.begin, True),
                (f"rr/{maestro}/modeReply", m.ModeReply, self.answered, False),
                ("rt/gazebo/model_states", m.ModelStates, self.drive, False),
            )
        ]

    def begin(self, message):
        """Learn the goals, or that the trial is over."""
        self.goals, self.next = [], 0
        if message.problemjson:
            problem = json.loads(message.problemjson)
            length, (tx, ty, theta) = problem["rnd"]["length"], problem["rnd"]["transform"]
            c, s = math.cos(theta), math.sin(theta)
            self.radius = problem["intersection_radius"]
            self.goals = [
                (length * (c * x - s * y) + tx, length * (s * x + c * y) + ty) for x, y in problem["goals"]
            ]

    def answered(self, reply):
        """Start the trial that is ready; a request's number is the mode it asks for."""
        if reply.guid == os.getpid() and reply.seq == READY and reply.result:
            self.ask(START)

    def drive(self, message):
        """Turn toward the next goal, then drive to it."""
        if not self.goals or "ego" not in message.name:
            return
        pose = message.pose[message.name.index("ego")]
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
        """Send a request to the maestro."""
        self.requests.write(m.ModeRequest(os.getpid(), mode, mode))

    def spin(self):
        """Take messages as they come, and ask for a trial while there is none."""
        while True:
            self.graph.wait(0.1)
            for reader, kind, take in self.readers:
                for message in self.graph.take(reader, kind, 100):
                    take(message)
            if not self.goals and time.monotonic() > self.asked + 0.3:
                self.asked = time.monotonic()
                self.ask(READY)


if __name__ == "__main__":
    controller = Controller()
    try:
        controller.spin()
    except KeyboardInterrupt:
        print("interrupted")
    finally:
        controller.graph.close()
