"""The last look before a tick: no motion that could bring about a contact, or leads off the road."""

from __future__ import annotations

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.boxes import Box, separation
from dubins_traffic.kernels.compile import jit, jit_inline
from dubins_traffic.kernels.trig import advance
from dubins_traffic.roads.lookup import nearest_segment
from dubins_traffic.roads.table import RoadTable

GUARD = 0.01
"""What is kept free beyond the other's worst motion, metres."""
NEAR = 0.2
"""What is farther away than this is not looked at: no tick leads there, metres."""
VERGE = 0.02
"""What an ego's centre keeps from the edge of the road whatever happens, metres."""


@jit
def leaves_road(
    x: float,
    y: float,
    c: float,
    s: float,
    speed: float,
    yaw_rate: float,
    period: float,
    edge: float,
    roads: RoadTable,
    net: int,
) -> bool:
    """Whether a motion for one tick takes the centre farther than `edge` from all roads, or farther beyond it."""
    nx, ny, _, _ = advance(x, y, c, s, speed, yaw_rate, period)
    _, after = nearest_segment(roads, net, nx, ny)
    if after <= edge * edge:
        return False
    _, before = nearest_segment(roads, net, x, y)
    return after >= before


@jit
def motion_is_safe(
    x: float,
    y: float,
    c: float,
    s: float,
    speed: float,
    yaw_rate: float,
    period: float,
    half_length: float,
    half_width: float,
    rounding: float,
    reach: float,
    ox: float,
    oy: float,
    oc: float,
    os: float,
    o_length: float,
    o_width: float,
    o_rounding: float,
    o_travel: float,
) -> bool:
    """Whether a motion for one tick can't touch another body, or leads away from it.

    Parameters
    ----------
    x, y, c, s, speed, yaw_rate, period : float
        Pose and command of the car that looks, and the tick's length.
    half_length, half_width, rounding, reach : float
        Its body (a rounded box) and the farthest of its points.
    ox, oy, oc, os, o_length, o_width, o_rounding : float
        The other body.
    o_travel : float
        How far any point of the other may get in the tick, 0 if it can't move.

    Notes
    -----
    A car that stands is never at fault in a collision, and neither is one that moves away.
    """
    turns = abs(yaw_rate) * reach if half_length + half_width > 0.0 else 0.0
    own = (abs(speed) + turns) * period
    if own == 0.0:
        return True
    other = Box(ox, oy, oc, os, o_length, o_width, o_rounding)
    gap, _, _, _, _ = separation(Box(x, y, c, s, half_length, half_width, rounding), other)
    if gap > own + o_travel + GUARD:
        return True
    least = gap
    last = gap
    for k in range(1, 5):
        nx, ny, nc, ns = advance(x, y, c, s, speed, yaw_rate, 0.25 * k * period)
        last, _, _, _, _ = separation(Box(nx, ny, nc, ns, half_length, half_width, rounding), other)
        least = min(least, last)
    return least > o_travel + GUARD or (least == gap and last - gap > 0.2 * own)


@jit_inline
def may_hit(
    x: float, y: float, c: float, s: float, speed: float, yaw_rate: float, period: float, half_length: float,
    half_width: float, rounding: float, reach: float, parts: Floats, first: int, last: int, near: float,
    spread: float,
) -> bool:  # fmt: skip
    """Whether a motion for one tick might touch an obstacle: the rows `first` to `last` - 1 of `ObstacleTable.part`.

    Looked at are those within `near` of what the car reaches; each is kept clear by `spread`, metres, more than GUARD.
    The rest is as in `motion_is_safe`.
    """
    for k in range(first, last):
        row = parts[k]
        dx = row[0] - x
        dy = row[1] - y
        far = reach + row[7] + near
        if dx * dx + dy * dy < far * far and not motion_is_safe(
            x, y, c, s, speed, yaw_rate, period, half_length, half_width, rounding, reach,
            row[0], row[1], row[2], row[3], row[4], row[5], row[6], spread,
        ):  # fmt: skip
            return True
    return False
