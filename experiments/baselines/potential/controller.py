"""An artificial potential field: drawn along the lane, pushed away from cars and from the edge of the road.

Khatib, Real-time obstacle avoidance for manipulators and mobile robots, IJRR 5(1), 1986, eq. 16 (the repulsion).
"""

from __future__ import annotations

from math import hypot

import dubins_traffic as dt
from dubins_traffic.cars.state import Observation
from dubins_traffic.problem.instance import Problem
from experiments.baselines.following import along_lane, toward

REACH = 1.2
"""Distance of centres from which on another car pushes, metres."""
PUSH = 0.05
"""How strongly, m^3/s."""


class Potential:
    """Adds the pull of a point ahead in the lane and the pushes of the cars that are near."""

    def start(self, problem: Problem) -> None:
        """Learn the problem."""
        self._navigator = dt.Navigator(problem)
        self._bounds = problem.car.bounds

    def act(self, observation: Observation) -> tuple[float, float]:
        """Go where the sum of the forces points, as fast as it is large."""
        x, y = observation.pose.x, observation.pose.y
        fx, fy = along_lane(self._navigator.look(observation), observation.pose, self._bounds)
        for car in observation.others:
            ax, ay = x - car.pose.x, y - car.pose.y
            away = hypot(ax, ay)
            if 0.0 < away < REACH:
                push = PUSH * (1.0 / away - 1.0 / REACH) / (away * away * away)
                fx, fy = fx + push * ax, fy + push * ay
        return toward(observation.pose, self._bounds, fx, fy)
