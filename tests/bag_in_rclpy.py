"""Prints, by rclpy's own deserialization, the positions in odometry that comes as base64, a message a line."""

import base64
import sys

from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message

for line in sys.stdin:
    odometry = deserialize_message(base64.b64decode(line), Odometry)
    position, twist = odometry.pose.pose.position, odometry.twist.twist
    print(odometry.header.frame_id, repr(position.x), repr(position.y), repr(twist.linear.x))
