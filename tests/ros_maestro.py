"""A maestro as that of 2016, by the facts that are known of it; run by the system's Python.

It takes the network and its bounds from parameters, draws instances, puts the cars where they begin, serves modes,
tells problems, lets physics run with START and pauses it again, and ends trials by the clock on the wall.
Prints one line of JSON for each trial that is over.
"""

import json
import random
import threading
import time

import rospy
from dubins_traffic_msgs.srv import MMode, MModeRequest, MModeResponse
from gazebo_msgs.msg import ModelState
from integrator_chains_msgs.msg import ProblemInstanceJSON
from std_srvs.srv import Empty

from with_parent import end_with_parent

READY, RUNNING, BUSY = "ready", "running", "busy"


class Maestro:
    def __init__(self):
        self.rnd = json.loads(rospy.get_param("/dubins_traffic/rnd"))
        self.agents = [name for name in rospy.get_param("/dubins_traffic/e_agents").split(",") if name]
        self.durations = [int(word) for word in rospy.get_param("~duration_bounds").split()]
        self.goals = [int(word) for word in rospy.get_param("~number_goals_bounds").split()]
        self.phase, self.reset = BUSY, threading.Event()
        self.changed = threading.Condition()
        self.problem = rospy.Publisher("~probleminstance_JSON", ProblemInstanceJSON, queue_size=1, latch=True)
        self.place = rospy.Publisher("/gazebo/set_model_state", ModelState, queue_size=20)
        rospy.wait_for_service("/gazebo/unpause_physics")
        self.pause = rospy.ServiceProxy("/gazebo/pause_physics", Empty)
        self.unpause = rospy.ServiceProxy("/gazebo/unpause_physics", Empty)
        while self.place.get_num_connections() == 0:
            time.sleep(0.01)

    def draw(self):
        rows, columns = self.rnd["shape"]
        goals = [[random.randrange(columns), random.randrange(rows)] for _ in range(random.randint(*self.goals))]
        return {"version": 0, "goals": goals, "rnd": self.rnd, "intersection_radius": 1.0}

    def answer(self, request):
        with self.changed:
            self.changed.wait_for(lambda: self.phase != BUSY)
            granted = self.phase == (RUNNING if request.mode == MModeRequest.RESET else READY)
            if request.mode == MModeRequest.START and granted:
                self.unpause()
                self.phase = RUNNING
            if request.mode == MModeRequest.RESET and granted:
                self.reset.set()
            self.changed.notify_all()
        return MModeResponse(granted)

    def trial(self):
        self.pause()
        for number, name in enumerate(["ego", *self.agents]):
            state = ModelState(model_name=name)
            state.pose.position.x, state.pose.position.y = 0.0, 1.5 * number
            state.pose.orientation.w = 1.0
            self.place.publish(state)
        problem, self.reset = self.draw(), threading.Event()
        with self.changed:
            self.phase = READY
            self.changed.notify_all()
            self.changed.wait_for(lambda: self.phase == RUNNING)
        self.problem.publish(rospy.Time.now(), json.dumps(problem))
        duration, began = random.randint(*self.durations), time.time()
        self.reset.wait(duration)
        with self.changed:
            self.phase = BUSY
        self.problem.publish(rospy.Time.now(), "")
        self.pause()
        print(json.dumps({"goals": problem["goals"], "seconds": time.time() - began}), flush=True)


end_with_parent()
rospy.init_node("dubins_traffic_maestro")
maestro = Maestro()
rospy.Service("~mode", MMode, maestro.answer)
for _ in range(rospy.get_param("/number_trials")):
    maestro.trial()
time.sleep(1.0)  # for the last message to leave
