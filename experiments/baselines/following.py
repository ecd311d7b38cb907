"""What several methods share: the command of a car that goes where a velocity points."""

from __future__ import annotations

from math import atan2, cos, hypot

from dubins_traffic.cars.body import Bounds
from dubins_traffic.cars.state import Pose

GAIN = 4.0
"""Yaw rate for an error of a radian, 1/s."""


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
