"""A client of the ROS 1 interface, written from its tables of names and types alone; run by the system's Python.

usage: ros_client.py ACTION...   with one ACTION per trial, each `what` or `what:commands`:
drive (to the end), or after so many commands reset, restart, die (SIGKILL), stop (SIGSTOP), flood, nan, leave, pause.
The action place is no trial: the ego is put elsewhere before one.
Prints one JSON object per line: what it has seen of each trial.
"""

import json
import math
import os
import signal
import sys
import threading
import time

import rospy
from dubins_traffic_msgs.msg import LabelStamped
from dubins_traffic_msgs.srv import MMode, MModeRequest
from gazebo_msgs.msg import ModelState, ModelStates
from geometry_msgs.msg import Twist
from integrator_chains_msgs.msg import ProblemInstanceJSON
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan
from std_srvs.srv import Empty


def law(pose):
    """A controller without thresholds: speed and yaw rate as smooth functions of the pose."""
    x, y = pose.position.x, pose.position.y
    theta = 2 * math.atan2(pose.orientation.z, pose.orientation.w)
    return 0.3 + 0.1 * math.sin(x), 0.5 * math.cos(theta) + 0.1 * math.sin(y)


PATIENCE = 600
"""Seconds for what is to come, on a busy machine."""


class Client:
    def __init__(self):
        self.lock = threading.Condition()
        self.problems, self.labels, self.odometry, self.scans = [], [], 0, 0
        self.states, self.active, self.sent = 0, False, 0
        self.action, self.limit = "drive", 10**9
        self.names, self.ego, self.paused = [], None, {}
        self.out = rospy.Publisher("/ego/mobile_base/commands/velocity", Twist, queue_size=100, tcp_nodelay=True)
        rospy.Subscriber("/dubins_traffic_maestro/probleminstance_JSON", ProblemInstanceJSON, self.problem)
        rospy.Subscriber("/loutput", LabelStamped, self.label)
        rospy.Subscriber("/ego/odom", Odometry, self.odom)
        rospy.Subscriber("/ego/scan", LaserScan, self.scan)
        rospy.Subscriber("/gazebo/model_states", ModelStates, self.state, tcp_nodelay=True)
        rospy.wait_for_service("/dubins_traffic_maestro/mode", timeout=PATIENCE)
        self.mode = rospy.ServiceProxy("/dubins_traffic_maestro/mode", MMode)
        while self.out.get_num_connections() == 0:
            time.sleep(0.01)

    def problem(self, message):
        with self.lock:
            self.problems.append(message.problemjson)
            self.active = bool(message.problemjson)
            self.lock.notify_all()

    def label(self, message):
        self.labels = message.label

    def odom(self, _message):
        self.odometry += 1

    def scan(self, message):
        self.scans += 1
        assert len(message.ranges) == 300

    def state(self, message):
        self.states += 1
        self.names = message.name
        self.ego = message.pose[message.name.index("ego")]
        with self.lock:
            if not self.active:
                return
            self.lock.notify_all()
            if self.sent >= self.limit:
                return
            self.sent += 1
        speed, yaw_rate = law(message.pose[message.name.index("ego")])
        command = Twist()
        command.linear.x, command.angular.z = speed, yaw_rate
        self.out.publish(command)

    def trial(self, action, limit):
        """Go through one trial and return what has been seen of it."""
        with self.lock:
            self.action, self.limit, self.sent = action, limit, 0
        while not self.mode(MModeRequest.READY).result:
            time.sleep(0.02)
        seen, states, odometry, scans = len(self.problems), self.states, self.odometry, self.scans
        started = self.mode(MModeRequest.START).result
        again = self.mode(MModeRequest.START).result
        with self.lock:
            if not self.lock.wait_for(lambda: len(self.problems) > seen, PATIENCE):
                raise SystemExit("no instance")
        self.until(lambda: self.sent >= limit or not self.active)
        refused = self.act(action)
        self.until(lambda: len(self.problems) > seen + 1)
        return {
            "action": action, "started": started, "again": again, "problem": json.loads(self.problems[seen]),
            "last": self.problems[seen + 1], "labels": self.labels, "names": self.names, "refused": refused,
            **self.paused, "states": self.states - states,
            "odometry": self.odometry - odometry, "scans": self.scans - scans,
        }  # fmt: skip

    def place(self):
        """Put the ego elsewhere and wait until it is seen there."""
        while not self.mode(MModeRequest.READY).result:
            time.sleep(0.02)
        out = rospy.Publisher("/gazebo/set_model_state", ModelState, queue_size=1)
        message = ModelState(model_name="ego")
        message.pose.position.x, message.pose.orientation.w = 1.25, 1.0
        while self.ego is None or abs(self.ego.position.x - 1.25) > 1e-6:
            out.publish(message)
            time.sleep(0.05)
        return {"x": self.ego.position.x}

    def pause(self):
        """Pause for half a second and say what moved meanwhile."""
        rospy.ServiceProxy("/gazebo/pause_physics", Empty)()
        time.sleep(0.2)
        before, states = self.ego.position.x, self.states
        time.sleep(0.5)
        self.paused = {"moved": self.ego.position.x - before, "states_while_paused": self.states - states}
        rospy.ServiceProxy("/gazebo/unpause_physics", Empty)()
        self.limit = 10**9

    def until(self, done):
        with self.lock:
            if not self.lock.wait_for(done, PATIENCE):
                raise SystemExit("nothing comes")

    def act(self, action):
        if action == "reset":
            return not self.mode(MModeRequest.RESET).result
        if action == "restart":
            return not self.mode(MModeRequest.RESTART).result
        if action == "pause":
            self.pause()
        if action == "die":
            os.kill(os.getpid(), signal.SIGKILL)
        if action == "stop":
            os.kill(os.getpid(), signal.SIGSTOP)
        if action == "leave":
            sys.exit(0)
        if action == "nan":
            self.out.publish(Twist(linear=Twist().linear, angular=type(Twist().angular)(0, 0, math.nan)))
        if action == "flood":
            command = Twist()
            while self.active:
                for _ in range(10):
                    self.out.publish(command)
                time.sleep(0.001)
        return False


if __name__ == "__main__":
    rospy.init_node("client", anonymous=True, disable_rosout=True, disable_signals=True)
    client = Client()
    for argument in sys.argv[1:]:
        what, _, count = argument.partition(":")
        seen = client.place() if what == "place" else client.trial(what, int(count or 10**9))
        print(json.dumps(seen), flush=True)
