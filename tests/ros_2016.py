"""An ego as the example controllers of 2016 wrote it; run by the system's Python.

It takes any answer to READY for yes, asks START once, never looks at what that says, and waits for the instance without
a limit, trial after trial.
Prints the number of each trial that is over.

usage: ros_2016.py TRIALS
"""

import sys
import threading

import rospy
from dubins_traffic_msgs.srv import MMode, MModeRequest
from geometry_msgs.msg import Twist
from integrator_chains_msgs.msg import ProblemInstanceJSON

from with_parent import end_with_parent

instance = threading.Event()
over = threading.Event()


def learn(message):
    if message.problemjson:
        over.clear()
        instance.set()
    else:
        instance.clear()
        over.set()


end_with_parent()
rospy.init_node("simple")
commands = rospy.Publisher("mobile_base/commands/velocity", Twist, queue_size=10)
rospy.Subscriber("/dubins_traffic_maestro/probleminstance_JSON", ProblemInstanceJSON, learn)
rospy.wait_for_service("/dubins_traffic_maestro/mode")
mode = rospy.ServiceProxy("/dubins_traffic_maestro/mode", MMode)
command = Twist()
command.linear.x, command.angular.z = 0.3, 0.1
for number in range(int(sys.argv[1])):
    while not mode(MModeRequest.READY):
        rospy.sleep(0.1)
    mode(MModeRequest.START)
    while not instance.is_set():
        instance.wait(1.0)
    rate = rospy.Rate(30)
    while not over.is_set():
        commands.publish(command)
        rate.sleep()
    print(number, flush=True)
