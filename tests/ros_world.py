"""A world of its own: cars as points with a heading, poses at 100 Hz; run by the system's Python.

usage: ros_world.py FAULT NAME x y [NAME x y]...   FAULT after a second of motion: none, freeze, jump, stop.
"""

import math
import sys
import threading
import time

import rospy
from gazebo_msgs.msg import ModelStates
from geometry_msgs.msg import Pose, PoseStamped, Twist

fault, rows = sys.argv[1], sys.argv[2:]
names = rows[::3]
cars = {
    name: [float(x), float(y), 0.0, 0.0, 0.0]
    for name, x, y in zip(names, rows[1::3], rows[2::3], strict=True)
}
lock = threading.Lock()


def take(message, name):
    with lock:
        cars[name][3:] = [message.linear.x, message.angular.z]


rospy.init_node("world", disable_rosout=True)
out = rospy.Publisher("/gazebo/model_states", ModelStates, queue_size=10)
trackers = [rospy.Publisher(f"/tracker/{name}", PoseStamped, queue_size=10) for name in names]
for name in names:
    rospy.Subscriber(f"/{name}/mobile_base/commands/velocity", Twist, take, name)
moving, pause, shown = 0.0, 0.01, None
before = time.monotonic()
while not rospy.is_shutdown():
    step, before = time.monotonic() - before, time.monotonic()
    with lock:
        for car in cars.values():
            car[0] += car[3] * math.cos(car[2]) * step
            car[1] += car[3] * math.sin(car[2]) * step
            car[2] += car[4] * step
        moving += step * any(car[3] for car in cars.values())
        poses = []
        for x, y, theta, _, _ in cars.values():
            pose = Pose()
            pose.position.x, pose.position.y = x, y
            pose.orientation.z, pose.orientation.w = math.sin(theta / 2), math.cos(theta / 2)
            poses.append(pose)
    late = moving > 1.0
    if late and fault == "jump":
        poses[0].position.x += 5.0
    shown = shown if late and fault == "freeze" else poses
    if not (late and fault == "stop"):
        out.publish(ModelStates(["ground_plane", *names], [Pose(), *shown], [Twist()] * (1 + len(names))))
    for tracker, pose in zip(trackers, poses, strict=True):
        tracker.publish(PoseStamped(pose=pose))
    time.sleep(pause)
