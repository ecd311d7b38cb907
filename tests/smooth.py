"""The controller of tests/ros_client.py in this process: smooth functions of the pose, no thresholds."""

import math

import dubins_traffic as dt


class Smooth:
    def start(self, problem: dt.Problem) -> None:
        self.problem = problem

    def act(self, observation: dt.Observation) -> tuple[float, float]:
        pose = observation.pose
        return 0.3 + 0.1 * math.sin(pose.x), 0.5 * math.cos(pose.theta) + 0.1 * math.sin(pose.y)
