"""The reference controller of 2016: round the goals in order, straight across country."""

from __future__ import annotations

import math

from dubins_traffic.cars.state import Command, Observation
from dubins_traffic.problem.instance import Problem

SPEED = 0.5
TURN = 0.9
TOLERANCE = 0.1

_DRIVE = Command(SPEED, 0.0)
_LEFT = Command(0.0, TURN)
_RIGHT = Command(0.0, -TURN)
_STAND = Command(0.0, 0.0)
_SLOPE = math.tan(TOLERANCE)


class Simple:
    """Turns in place at 0.9 rad/s while the bearing error exceeds 0.1 rad, else drives at 0.5 m/s.

    A goal counts as reached within half the intersection radius; then the next is taken, after the last the
    first. Roads, cars and obstacles are ignored. Without goals it stands.
    """

    def __init__(self) -> None:
        self._goals: list[tuple[float, float]] = []
        self._next = 0
        self._near2 = 0.0

    def start(self, problem: Problem) -> None:
        """Learn the goals' places."""
        points = problem.network.points[list(problem.goal_vertices)] if problem.goals else ()
        self._goals = [(float(x), float(y)) for x, y in points]
        self._next = 0
        self._near2 = (0.5 * problem.intersection_radius) ** 2

    def act(self, observation: Observation) -> Command:
        """Turn toward the next goal, or drive to it."""
        if not self._goals:
            return _STAND
        x, y, c, s = observation.pose
        gx, gy = self._goals[self._next]
        dx, dy = gx - x, gy - y
        if dx * dx + dy * dy < self._near2:
            self._next = (self._next + 1) % len(self._goals)
            gx, gy = self._goals[self._next]
            dx, dy = gx - x, gy - y
            if dx == 0.0 and dy == 0.0:
                dx = 1.0
        ahead, left = dx * c + dy * s, dy * c - dx * s
        if ahead > 0.0 and abs(left) <= _SLOPE * ahead:
            return _DRIVE
        return _LEFT if left >= 0.0 else _RIGHT
