"""Following a path: where a car is on it, what lies ahead, and the command that keeps it there.

The columns of a path's rows are those of `policies.lanes.paths`. A car may follow at an offset to the left of the path.
"""

from __future__ import annotations

from math import sqrt

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.trig import advance
from dubins_traffic.policies.lanes.paths import BEND, LENGTH, PIVOT, C, S, X, Y

AHEAD = 0.2
"""How far ahead on its path a car aims, metres."""
REACHED = 0.02
"""A corner counts as reached within this, metres."""


@jit
def place_on(path: Floats, row: int, sigma: float) -> tuple[float, float, float, float]:
    """Return point and unit tangent of a path `sigma` metres after the start of a row (beyond it: continued)."""
    p = path[row]
    bend = p[BEND]
    if bend != 0.0:
        sigma = min(max(sigma, -0.5 / abs(bend)), 0.5 / abs(bend))
    return advance(p[X], p[Y], p[C], p[S], 1.0, bend, sigma)


@jit
def project(path: Floats, row: int, sigma: float, x: float, y: float) -> tuple[float, float]:
    """Return (sigma, left): metres along the row's piece and left of it, by two Newton steps from `sigma`."""
    left = 0.0
    for _ in range(2):
        px, py, tx, ty = place_on(path, row, sigma)
        left = (y - py) * tx - (x - px) * ty
        along = (x - px) * tx + (y - py) * ty
        sigma += along / max(1.0 - path[row, BEND] * left, 0.25)
    return sigma, left


@jit
def next_row(row: int, first: int, end: int, loop: int) -> int:
    """Return the row after `row` of a path in the rows `first` to `end` - 1."""
    return row + 1 if row + 1 < end else first + loop


@jit
def locate(
    path: Floats, row: int, sigma: float, x: float, y: float, first: int, end: int, loop: int
) -> tuple[int, float, float, float]:
    """Return (row, sigma, left, travelled): the place on the path nearest to a car that was last at (row, sigma).

    `travelled` are metres along the path since then, negative backwards.
    """
    travelled = 0.0
    for _ in range(6):
        now, left = project(path, row, sigma, x, y)
        length = path[row, LENGTH]
        early = REACHED if path[row, PIVOT] != 0.0 else 0.0
        if now >= length - early:
            travelled += length - sigma
            row = next_row(row, first, end, loop)
            sigma = 0.0
        elif now < -0.01 and sigma <= 0.0 and row > first and path[row - 1, PIVOT] == 0.0:
            row -= 1
            sigma = path[row, LENGTH] - 1e-6
        else:
            if row > first:
                now = max(now, min(sigma, 0.0))
            return row, now, left, travelled + now - sigma
    return row, sigma, 0.0, travelled


@jit
def ahead_on(
    path: Floats, row: int, sigma: float, distance: float, first: int, end: int, loop: int, corners: bool
) -> tuple[int, float]:
    """Return (row, sigma) of the place `distance` metres on; with `corners` not beyond the next corner, where the
    piece is continued instead.
    """
    sigma += distance
    for _ in range(64):
        if sigma <= path[row, LENGTH] or (corners and path[row, PIVOT] != 0.0):
            break
        sigma -= path[row, LENGTH]
        row = next_row(row, first, end, loop)
    return row, sigma


@jit
def steer(
    x: float,
    y: float,
    c: float,
    s: float,
    goal_x: float,
    goal_y: float,
    speed: float,
    yaw_most: float,
    radius: float,
) -> tuple[float, float, bool]:
    """Return (speed, yaw rate, turns) of the arc through a point, or of a turn in place toward it.

    A car turns in place while the point lies more than 60 degrees off its heading. Backwards (`speed` < 0) the
    point should lie behind. The speed falls where the arc asks for more than `yaw_most`. The arc is never tighter
    than `radius`.
    """
    dx = goal_x - x
    dy = goal_y - y
    d2 = dx * dx + dy * dy
    if d2 < 1e-12:
        return speed, 0.0, False
    along = c * dx + s * dy
    left = c * dy - s * dx
    if speed >= 0.0 and along < 0.5 * sqrt(d2):
        return 0.0, yaw_most if left >= 0.0 else -yaw_most, True
    if speed < 0.0 and -along < 0.5 * sqrt(d2):
        return 0.0, 0.0, False
    bend = 2.0 * left / d2
    if radius > 0.0:
        bend = min(max(bend, -1.0 / radius), 1.0 / radius)
    if abs(bend * speed) > yaw_most:
        speed = yaw_most / abs(bend) if speed > 0.0 else -yaw_most / abs(bend)
    return speed, speed * bend, False
