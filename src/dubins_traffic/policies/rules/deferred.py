"""Commands that are put off, and worked out for all cars of a trial at once (compiled).

Cars with nothing close around them only follow a line. What these do is kept in columns, and found for several cars in
one go of the processor, which takes less time than for one after another.
"""

from __future__ import annotations

import numpy as np

from dubins_traffic.kernels.arrays import BLOCK, WIDE, Floats
from dubins_traffic.kernels.compile import jit_inline
from dubins_traffic.policies.rules.steering import ALIGNED, ASTRAY, SLANT, slowed, steer
from dubins_traffic.policies.rules.tables import (
    DUE,
    LATE,
    LATE_BEND,
    LATE_C,
    LATE_LEFT,
    LATE_S,
    LATE_SPEED,
    LATE_X,
    LATE_Y,
    LATE_YAW,
    ROUND,
    Traffic,
)
from dubins_traffic.rules.propositions import LEFT


@jit_inline
def note(
    b: int, n: int, speed: float, left: float, px: float, py: float, bend: float, traffic: Traffic
) -> None:
    """Leave the command of a car to `decide_deferred`; its speed is one for the bend already (`steering.slowed`)."""
    state, scratch = traffic.state, traffic.scratch
    late = scratch.late
    k = (n & -BLOCK) * LATE + (n & (BLOCK - 1))
    late[k + BLOCK * DUE] = 1.0
    late[k + BLOCK * LATE_SPEED] = speed
    late[k + BLOCK * LATE_LEFT] = left
    late[k + BLOCK * LATE_X] = px
    late[k + BLOCK * LATE_Y] = py
    late[k + BLOCK * LATE_BEND] = bend
    late[k + BLOCK * LATE_C] = state.c[b, n]
    late[k + BLOCK * LATE_S] = state.s[b, n]


@jit_inline
def defer(
    b: int,
    n: int,
    speed: float,
    left: float,
    px: float,
    py: float,
    bend: float,
    close: bool,
    traffic: Traffic,
) -> bool:
    """Leave the command of a car with nothing close around it, that just drives on, to `decide_deferred`, if it is
    one.
    """
    labels, obstacles, drivers = traffic.labels, traffic.obstacles, traffic.drivers
    vehicle = drivers.vehicle[b]
    free = not close and obstacles.off[b] == obstacles.off[b + 1] and drivers.car[b, n].kind != ROUND
    bound = drivers.car[b, n].aside != 0.0 or vehicle.tightest > 0.0
    astray = labels.lane[b, n] < 0 and left > ASTRAY
    if not free or bound or astray or np.int64(labels.bits[b, n]) & LEFT != 0:
        return False
    note(b, n, slowed(speed, bend, vehicle.yaw_most), left, px, py, bend, traffic)
    return True


@jit_inline
def decide_deferred(b: int, traffic: Traffic, commands: Floats) -> None:
    """Write the commands that have been put off.

    The columns of a block are a fixed number of cars apart, and nothing in the loop over its cars is a branch: so the
    compiler sees that several may be taken at once.
    """
    state, drivers, scratch = traffic.state, traffic.drivers, traffic.scratch
    vehicle = drivers.vehicle[b]
    limit, period = vehicle.yaw_most, vehicle.period
    late = scratch.late
    for first in range(0, state.count[b], BLOCK):
        here = min(state.count[b] - first, BLOCK)
        begin = first * LATE
        for k in range(begin, begin + ((here + WIDE - 1) & -WIDE)):
            speed, yaw_rate = steer(
                late[k + BLOCK * LATE_C], late[k + BLOCK * LATE_S], late[k + BLOCK * LATE_LEFT],
                late[k + BLOCK * LATE_X], late[k + BLOCK * LATE_Y], late[k + BLOCK * LATE_BEND],
                late[k + BLOCK * LATE_SPEED], SLANT, ALIGNED, limit, 0.0, period,
            )  # fmt: skip
            late[k + BLOCK * LATE_SPEED] = speed
            late[k + BLOCK * LATE_YAW] = yaw_rate
        for n in range(here):
            k = begin + n
            if late[k + BLOCK * DUE] != 0.0:
                late[k + BLOCK * DUE] = 0.0
                commands[b, first + n, 0] = late[k + BLOCK * LATE_SPEED]
                commands[b, first + n, 1] = late[k + BLOCK * LATE_YAW]
