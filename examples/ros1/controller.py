#!/usr/bin/python3
"""An ego controller as a ROS 1 node: round the goals in order, straight across country, as `simple` of 2016.

It knows nothing of dubins-traffic but names and types: topics, the mode service, the JSON of an instance. Start it
beside ``dubins-traffic ros1 run demo --master``; it drives trial after trial until it is interrupted.
"""

import json
import math
import threading

import rospy
from dubins_traffic_msgs.msg import LabelStamped
from dubins_traffic_msgs.srv import MMode, MModeRequest
from gazebo_msgs.msg import ModelStates
from geometry_msgs.msg import Twist
from integrator_chains_msgs.msg import ProblemInstanceJSON

SPEED, YAW_RATE, TOLERANCE = 0.5, 0.9, 0.1


class Controller:
    """Answers each message of model states with one command."""

    def __init__(self):
        self.goals, self.radius, self.next = [], 1.0, 0
        self.labels = []
        self.idle = threading.Event()
        self.idle.set()
        self.commands = rospy.Publisher("/ego/mobile_base/commands/velocity", Twist, queue_size=10, tcp_nodelay=True)
        self.mode = rospy.ServiceProxy("/dubins_traffic_maestro/mode", MMode)
        rospy.Subscriber("/dubins_traffic_maestro/probleminstance_JSON", ProblemInstanceJSON, self.begin)
        rospy.Subscriber("/loutput", LabelStamped, self.look)
        rospy.Subscriber("/gazebo/model_states", ModelStates, self.drive, tcp_nodelay=True)

    def begin(self, message):
        """Learn the goals, or that the trial is over."""
        if not message.problemjson:
            self.goals = []
            self.idle.set()
            return
        problem = json.loads(message.problemjson)
        length, (tx, ty, theta) = problem["rnd"]["length"], problem["rnd"]["transform"]
        c, s = math.cos(theta), math.sin(theta)
        self.radius, self.next = problem["intersection_radius"], 0
        self.goals = [(length * (c * x - s * y) + tx, length * (s * x + c * y) + ty) for x, y in problem["goals"]]

    def look(self, message):
        """Note which labels hold."""
        self.labels = message.label

    def drive(self, message):
        """Turn toward the next goal, then drive to it."""
        goals = self.goals
        if not goals or "ego" not in message.name:
            return
        pose = message.pose[message.name.index("ego")]
        gx, gy = goals[self.next % len(goals)]
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

    def ask(self):
        """Start the next trial once there is one, trial after trial."""
        rospy.wait_for_service("/dubins_traffic_maestro/mode")
        while not rospy.is_shutdown():
            if self.idle.wait(0.1) and self.mode(MModeRequest.READY).result:
                self.idle.clear()
                if not self.mode(MModeRequest.START).result:
                    self.idle.set()
            rospy.sleep(0.05)


if __name__ == "__main__":
    rospy.init_node("controller", anonymous=True)
    try:
        Controller().ask()
    except (rospy.ROSInterruptException, rospy.ServiceException):
        rospy.loginfo("the session is over")
