"""What a node of ROS 2 is shown of a session with `--markers`, as JSON: the first of each, roads late and latched."""

import json

import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from visualization_msgs.msg import MarkerArray

rclpy.init()
node, seen = Node("viewer"), {}
latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def keep(name, message):
    """Keep the first array of a topic."""
    seen.setdefault(
        name,
        [
            [
                one.header.frame_id, one.ns, one.id, one.type, one.action, one.pose.position.x, one.pose.position.y,
                one.pose.orientation.z, one.pose.orientation.w, one.scale.x, len(one.points), one.color.a,
            ]
            for one in message.markers
        ],
    )  # fmt: skip


node.create_subscription(MarkerArray, "/dubins_traffic/cars", lambda one: keep("cars", one), 10)
while "cars" not in seen:
    rclpy.spin_once(node, timeout_sec=0.1)
node.create_subscription(MarkerArray, "/dubins_traffic/roads", lambda one: keep("roads", one), latched)
while "roads" not in seen:
    rclpy.spin_once(node, timeout_sec=0.1)
print(json.dumps(seen))
