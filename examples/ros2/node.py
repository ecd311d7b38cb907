#!/usr/bin/env python3
"""An ego controller as a node of ROS 2: round the goals in order, straight across country.

It needs rclpy and messages that come with ROS 2, and nothing of this package. Start it beside
``dubins-traffic ros2 run demo --lockstep``; it drives trial after trial until it is interrupted.
"""

import json
import math

import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

SPEED, YAW_RATE, TOLERANCE = 0.5, 0.9, 0.1
MAESTRO = "/dubins_traffic_maestro"


class Controller(Node):
    """Answers each message of the ego's odometry with one command."""

    def __init__(self):
        super().__init__("controller")
        self.goals, self.radius, self.next = [], 1.0, 0
        self.commands = self.create_publisher(Twist, "/ego/mobile_base/commands/velocity", 10)
        self.asks = self.create_publisher(String, f"{MAESTRO}/ask", 10)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(String, f"{MAESTRO}/probleminstance_JSON", self.begin, latched)
        self.create_subscription(String, f"{MAESTRO}/answer", self.answered, 10)
        self.create_subscription(Odometry, "/ego/odom", self.drive, 10)
        self.create_timer(0.5, self.ask_for_a_trial)

    def begin(self, message):
        """Learn the goals, or that the trial is over."""
        self.goals, self.next = [], 0
        if message.data:
            problem = json.loads(message.data)
            length, (tx, ty, theta) = problem["rnd"]["length"], problem["rnd"]["transform"]
            c, s = math.cos(theta), math.sin(theta)
            self.radius = problem["intersection_radius"]
            self.goals = [
                (length * (c * x - s * y) + tx, length * (s * x + c * y) + ty) for x, y in problem["goals"]
            ]

    def ask_for_a_trial(self):
        """Ask for a trial while there is none: what is published before anybody has come is lost."""
        if not self.goals:
            self.asks.publish(String(data="READY"))

    def answered(self, message):
        """Start the trial that is ready."""
        if message.data == "READY granted":
            self.asks.publish(String(data="START"))

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
        command = Twist()
        if abs(error) > TOLERANCE:
            command.angular.z = math.copysign(YAW_RATE, error)
        else:
            command.linear.x = SPEED
        self.commands.publish(command)


if __name__ == "__main__":
    rclpy.init()
    try:
        rclpy.spin(Controller())
    except (KeyboardInterrupt, ExternalShutdownException):
        print("interrupted")
