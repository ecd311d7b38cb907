"""A world of its own over ROS 1 (`cars_outside`); run by the system's Python."""

import sys

import rospy
from gazebo_msgs.msg import ModelStates
from geometry_msgs.msg import Pose, PoseStamped, Twist

from cars_outside import Cars

cars = Cars(*sys.argv[1:])
rospy.init_node("world", disable_rosout=True)
out = rospy.Publisher("/gazebo/model_states", ModelStates, queue_size=10)
trackers = [rospy.Publisher(f"/tracker/{name}", PoseStamped, queue_size=10) for name in cars.names]


def take(message, name):
    cars.take(name, message.linear.x, message.angular.z)


for name in cars.names:
    rospy.Subscriber(f"/{name}/mobile_base/commands/velocity", Twist, take, name)
while not rospy.is_shutdown():
    poses = []
    for _, x, y, z, w in cars.poses() or ():
        pose = Pose()
        pose.position.x, pose.position.y = x, y
        pose.orientation.z, pose.orientation.w = z, w
        poses.append(pose)
    if poses:
        out.publish(ModelStates(["ground_plane", *cars.names], [Pose(), *poses], [Twist()] * (1 + len(poses))))
    for tracker, pose in zip(trackers, poses, strict=False):
        tracker.publish(PoseStamped(pose=pose))
    cars.pause()
