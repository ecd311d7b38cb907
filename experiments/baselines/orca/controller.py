"""Optimal reciprocal collision avoidance (ORCA) round a velocity along the lane, by `pyrvo`, the RVO2 library.

van den Berg, Guy, Lin, Manocha, Reciprocal n-body collision avoidance, ISRR 2009.
"""

from __future__ import annotations

import pyrvo

import dubins_traffic as dt
from dubins_traffic.cars.state import Observation, Pose, Twist
from dubins_traffic.problem.instance import Problem
from experiments.baselines.following import along_lane, toward

MARGIN = 0.08
"""Added to the radius of each car, since cars turn before they can go where ORCA sends them, metres."""
HORIZON = 2.0
"""For so long nobody is to be met, seconds."""
MOST = 10
"""Most cars that are looked at."""


class Orca:
    """Takes the velocity nearest to the one that it prefers that meets nobody, if each does half of what is needed."""

    def start(self, problem: Problem) -> None:
        """Learn the problem."""
        self._navigator = dt.Navigator(problem)
        self._bounds, car = problem.car.bounds, problem.car
        self._period = problem.period
        self._radius = car.body.reach + MARGIN
        self._sight = problem.sensing_radius

    def act(self, observation: Observation) -> tuple[float, float]:
        """Set up all that is seen anew, and take the velocity of the ego after one step."""
        pose = observation.pose
        simulator: pyrvo.RVOSimulator = pyrvo.RVOSimulator(
            self._period, self._sight, MOST, HORIZON, HORIZON, self._radius, self._bounds.speed
        )
        for which, twist in (
            (pose, observation.twist),
            *((car.pose, car.twist) for car in observation.others),
        ):
            number = simulator.add_agent((which.x, which.y))
            velocity = _velocity(which, twist)
            simulator.set_agent_velocity(number, velocity)
            simulator.set_agent_pref_velocity(number, velocity)
        simulator.set_agent_pref_velocity(0, along_lane(self._navigator.look(observation), pose, self._bounds))
        simulator.do_step()
        found = simulator.get_agent_velocity(0)
        return toward(pose, self._bounds, found.x, found.y)


def _velocity(pose: Pose, twist: Twist) -> tuple[float, float]:
    return twist.speed * pose.c, twist.speed * pose.s
