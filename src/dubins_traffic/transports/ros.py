"""What messages of ROS 1 and ROS 2 share: quaternions of headings, and time stamps."""

from __future__ import annotations

from math import isfinite, sqrt
from time import time
from typing import Any

from dubins_traffic.cars.state import Pose
from dubins_traffic.protocols import View


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


def placed(told: Any) -> Pose | None:
    """Return what a geometry_msgs/Pose tells of a car on the plane, None if its numbers are none of a pose."""
    x, y, z, w = told.position.x, told.position.y, told.orientation.z, told.orientation.w
    if z == w == 0.0 or not all(map(isfinite, (x, y, z, w))):
        return None
    return Pose(x, y, *heading(z, w))


class Stamps:
    """Time of a session, from one trial to the next, and while a world is only shown.

    Parameters
    ----------
    interval : float
        Seconds by which time goes on with each view of a world that stands still.
    clock : bool
        Whether stamps are simulated time; else the wall clock's.
    """

    def __init__(self, interval: float, *, clock: bool) -> None:
        self._interval, self._clock = interval, clock
        self._before = 0.0
        self._shown = 0.0

    def begin(self) -> None:
        """Go on with the time of a new trial."""
        self._before += self._shown
        self._shown = 0.0

    def see(self, view: View) -> None:
        """Take the time of a view that is about to be sent."""
        if view.running and view.time > 0.0:
            self._shown = max(self._shown, view.time)
        else:
            self._before += self._interval

    @property
    def simulated(self) -> float:
        """Simulated seconds since the session began."""
        return self._before + self._shown

    def now(self) -> float:
        """Return the stamp of what is sent now, seconds."""
        return self.simulated if self._clock else time()
