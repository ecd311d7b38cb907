"""Answers each message of model states with a Twist, until it is ended; run by the system's Python.

usage: ros1_peer.py IN OUT. Prints how many it has answered, and in how many seconds.
"""

import signal
import sys
import time

import rospy
from gazebo_msgs.msg import ModelStates
from geometry_msgs.msg import Twist

times = []


def answer(_message, out):
    times.append(time.monotonic())
    command = Twist()
    command.linear.x, command.angular.z = 0.3, 0.1
    out.publish(command)


def finish(_signal, _frame):
    print(len(times), times[-1] - times[0] if times else 0.0, flush=True)
    sys.exit(0)


rospy.init_node("peer", anonymous=True, disable_signals=True, disable_rosout=True)
publisher = rospy.Publisher(sys.argv[2], Twist, queue_size=100, tcp_nodelay=True)
subscriber = rospy.Subscriber(sys.argv[1], ModelStates, answer, publisher, tcp_nodelay=True)
signal.signal(signal.SIGTERM, finish)
while True:
    time.sleep(0.1)
