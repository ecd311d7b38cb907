"""What a node of ROS 2 sees of a session, as JSON: nodes, services, and who publishes TOPIC."""

import json
import sys

import rclpy
from rclpy.node import Node

rclpy.init()
node = Node("looker")
while not (there := node.get_publishers_info_by_topic(sys.argv[1])):
    rclpy.spin_once(node, timeout_sec=0.1)
while len(node.get_node_names()) < 2:
    rclpy.spin_once(node, timeout_sec=0.1)
kinds = [[each.topic_type, str(each.topic_type_hash)] for each in there]
print(json.dumps({"nodes": node.get_node_names(), "publishers": kinds, "services": node.get_service_names_and_types()}))
