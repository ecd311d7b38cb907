"""Between headings as unit vectors and the quaternions of ROS."""

from __future__ import annotations

from math import isfinite, sqrt

from dubins_traffic.cars.state import Pose


def half(c: float, s: float) -> tuple[float, float]:
    """Return z and w of the quaternion that turns the x axis to (c, s).

    By the larger of the two half-angle formulas, so that no digits are lost near half a turn.
    """
    if c >= 0.0:
        w = sqrt(0.5 * (1.0 + c))
        return 0.5 * s / w, w
    z = sqrt(0.5 * (1.0 - c))
    return (z, 0.5 * s / z) if s >= 0.0 else (-z, -0.5 * s / z)


def heading(z: float, w: float) -> tuple[float, float]:
    """Return the unit vector to which the quaternion (0, 0, z, w), of any length but 0, turns the x axis."""
    length = w * w + z * z
    return (w * w - z * z) / length, 2.0 * w * z / length


def placed(x: float, y: float, z: float, w: float) -> Pose | None:
    """Return the pose at (x, y) turned by (0, 0, z, w), None if these numbers are none of a pose."""
    if z == w == 0.0 or not all(map(isfinite, (x, y, z, w))):
        return None
    return Pose(x, y, *heading(z, w))
