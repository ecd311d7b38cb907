"""What several methods share: the velocity along the lane, and the command of a car that goes where one points."""

from __future__ import annotations

from math import atan2, cos, hypot

from dubins_traffic.cars.body import Bounds
from dubins_traffic.cars.state import Pose
from dubins_traffic.controllers.navigator import Situation

LOOK = 0.4
"""How far ahead on its line lies the point that a car is drawn to, metres."""
GAIN = 4.0
"""Yaw rate for an error of a radian, 1/s."""


def at_top_speed(pose: Pose, bounds: Bounds, x: float, y: float) -> tuple[float, float]:
    """Return the velocity (x, y), m/s, at the top speed from a pose toward a point, metres."""
    dx, dy = x - pose.x, y - pose.y
    share = bounds.speed / max(hypot(dx, dy), 1e-9)
    return share * dx, share * dy


def along_lane(here: Situation, pose: Pose, bounds: Bounds) -> tuple[float, float]:
    """Return the velocity (x, y), m/s, at the top speed toward a point ahead on the line to follow."""
    aim = here.line(LOOK)
    return at_top_speed(pose, bounds, aim.x, aim.y)


def toward(pose: Pose, bounds: Bounds, dx: float, dy: float) -> tuple[float, float]:
    """Return speed (m/s) and yaw rate (rad/s) of a car that is to move with the velocity (dx, dy), m/s.

    It turns toward it, and drives as fast as the part of it that lies along its heading says.
    """
    speed = hypot(dx, dy)
    if speed < 1e-9:
        return 0.0, 0.0
    error = atan2(dy * pose.c - dx * pose.s, dx * pose.c + dy * pose.s)
    ahead = speed * max(0.0, cos(error))
    yaw_rate = max(-bounds.yaw_rate, min(GAIN * error, bounds.yaw_rate))
    return max(bounds.speed_low, min(ahead, bounds.speed)), yaw_rate
