"""A world of its own over ROS 2, by rclpy (`cars_outside`), as trackers publish: lossy."""

import contextlib
import sys
import threading
from functools import partial

import rclpy
from geometry_msgs.msg import PoseStamped, Twist
from rclpy.executors import ExternalShutdownException
from rclpy.qos import qos_profile_sensor_data

from cars_outside import Cars

cars = Cars(*sys.argv[1:])
rclpy.init()
node = rclpy.create_node("world")
trackers = [node.create_publisher(PoseStamped, f"/{name}/pose", qos_profile_sensor_data) for name in cars.names]


def take(name, message):
    cars.take(name, message.linear.x, message.angular.z)


def spin():
    with contextlib.suppress(ExternalShutdownException):
        rclpy.spin(node)


for name in cars.names:
    node.create_subscription(Twist, f"/{name}/mobile_base/commands/velocity", partial(take, name), 10)
threading.Thread(target=spin, daemon=True).start()
while rclpy.ok():
    for tracker, (_, x, y, z, w) in zip(trackers, cars.poses() or (), strict=False):
        message = PoseStamped()
        message.pose.position.x, message.pose.position.y = x, y
        message.pose.orientation.z, message.pose.orientation.w = z, w
        tracker.publish(message)
    cars.pause()
