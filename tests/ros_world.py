"""A world of its own: cars as points with a heading, poses at 100 Hz; run by the system's Python.

usage: ros_world.py FAULT NAME x y heading [NAME x y heading]...

FAULT after a second of motion: none, freeze, jump, stop.

FAULT may be DELAY,NOISE,LOST instead: commands take effect so many seconds late, poses are off by up to so many metres,
such a share of commands is lost, and poses come at 27 to 33 Hz.
"""

import collections
import math
import random
import sys
import threading
import time

import rospy
from gazebo_msgs.msg import ModelStates
from geometry_msgs.msg import Pose, PoseStamped, Twist

fault, rows = sys.argv[1], sys.argv[2:]
is_disturbed = "," in fault
delay, noise, lost = (float(part) for part in fault.split(",")) if is_disturbed else (0.0, 0.0, 0.0)
dice = random.Random(1)
late_commands = collections.deque()
names = rows[::4]
cars = {
    name: [float(x), float(y), float(heading), 0.0, 0.0]
    for name, x, y, heading in zip(names, rows[1::4], rows[2::4], rows[3::4], strict=True)
}
lock = threading.Lock()


def take(message, name):
    with lock:
        if dice.random() >= lost:
            late_commands.append((time.monotonic() + delay, name, [message.linear.x, message.angular.z]))


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
        while late_commands and late_commands[0][0] <= before:
            _, name, command = late_commands.popleft()
            cars[name][3:] = command
        for car in cars.values():
            car[0] += car[3] * math.cos(car[2]) * step
            car[1] += car[3] * math.sin(car[2]) * step
            car[2] += car[4] * step
        moving += step * any(car[3] for car in cars.values())
        poses = []
        for x, y, theta, _, _ in cars.values():
            pose = Pose()
            pose.position.x, pose.position.y = (
                x + dice.uniform(-noise, noise),
                y + dice.uniform(-noise, noise),
            )
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
    if is_disturbed:
        pause = 1.0 / dice.uniform(27.0, 33.0)
    time.sleep(pause)
