"""The controller `simple`, the reference of 2016: visits the goals in order, in straight lines off the roads."""

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
    first. Roads, cars and obstacles are ignored. Without goals it stands. A car that can't turn in place drives the
    arc through the goal, as fast.
    """

    def __init__(self) -> None:
        self._arcs: Command | None = None
        self._radius = 0.0
        self._goals: list[tuple[float, float]] = []
        self._next = 0
        self._near2 = 0.0

    def start(self, problem: Problem) -> None:
        """Look up where the goals are."""
        points = problem.network.points[list(problem.goal_vertices)] if problem.goals else ()
        self._goals = [(float(x), float(y)) for x, y in points]
        self._next = 0
        self._near2 = (0.5 * problem.intersection_radius) ** 2
        bounds = problem.car.bounds
        if bounds.turning_radius > 0.0 or bounds.speed_low > 0.0:
            speed = min(max(SPEED, bounds.speed_low), bounds.speed)
            self._arcs = Command(speed, min(TURN, bounds.yaw_rate))
            self._radius = max(bounds.turning_radius, speed / self._arcs.yaw_rate)

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
        if self._arcs is not None:
            return _on_arc(ahead, left, self._arcs.speed, self._radius)
        if ahead > 0.0 and abs(left) <= _SLOPE * ahead:
            return _DRIVE
        return _LEFT if left >= 0.0 else _RIGHT


def _on_arc(ahead: float, left: float, speed: float, radius: float) -> Command:
    """Return the command of a car that drives to a point on an arc no tighter than `radius`, metres.

    The point is `ahead` and `left` of the car, metres. A point within the car's tightest circle can't be reached: the
    car drives straight on until it can. Toward a point behind it, the car turns as tightly as it can, to the left if
    the point lies straight behind.
    """
    square = ahead * ahead + left * left
    bend = 2.0 * abs(left) / square if square > 0.0 else math.inf  # so near that the square is 0: it is in the circle
    if bend > 1.0 / radius:
        return Command(speed, 0.0)
    if ahead < 0.0:
        bend = 1.0 / radius
    return Command(speed, speed * bend if left >= 0.0 else -speed * bend)
