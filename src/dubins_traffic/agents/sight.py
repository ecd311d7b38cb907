"""Who must stand: cars with something near in the sector that the 2016 laser covers."""

from __future__ import annotations

from math import sqrt

from dubins_traffic.agents.tables import (
    BARRED,
    HALF_LENGTH,
    HALF_WIDTH,
    PATIENCE,
    PERIOD,
    ROUNDING,
    SEES,
    SPAN,
    SPEED,
    STOP,
    TIGHT,
    Workspace,
)
from dubins_traffic.cars.near import candidates
from dubins_traffic.cars.state import State
from dubins_traffic.cars.tables import ObstacleTable
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.boxes import nearest_in_box, separation
from dubins_traffic.kernels.compile import jit

COS_EDGE = -0.4161468365471424
SIN_EDGE = 0.9092974268256817
"""Cosine and sine of 2.0 rad, the edge of the sector on either side of the heading."""
ELBOW = 0.1
"""A car whose patience ended keeps this free ahead of its body, and what it drives in a tick, metres."""
SHOULDER = 0.03
"""It keeps this free to either side of its body, metres."""
Numbers = tuple[float, float, float, float]


@jit
def sees(
    x: float,
    y: float,
    c: float,
    s: float,
    stop: float,
    ox: float,
    oy: float,
    oc: float,
    os: float,
    a: float,
    b: float,
    r: float,
) -> bool:
    """Return whether a rounded box has a point nearer than `stop` to (x, y) and at most 2.0 rad off the heading.

    Exact: either the point of the box that is nearest lies in the sector, or else the nearest one in the sector
    lies on one of the sector's edges.
    """
    px, py = nearest_in_box(x, y, ox, oy, oc, os, a, b)
    dx = px - x
    dy = py - y
    d = sqrt(dx * dx + dy * dy)
    if d - r >= stop:
        return False
    if d <= r or c * dx + s * dy >= COS_EDGE * d:
        return True
    half = 0.5 * stop
    for side in range(2):
        sine = SIN_EDGE if side == 0 else -SIN_EDGE
        ec = c * COS_EDGE - s * sine
        es = s * COS_EDGE + c * sine
        gap, _, _, _, _ = separation(
            x + half * ec, y + half * es, ec, es, half, 0.0, 0.0, ox, oy, oc, os, a, b, r
        )  # fmt: skip
        if gap < 0.0:
            return True
    return False


@jit
def in_way(
    x: float,
    y: float,
    c: float,
    s: float,
    front: float,
    side: float,
    ox: float,
    oy: float,
    oc: float,
    os: float,
    a: float,
    b: float,
    r: float,
) -> bool:
    """Return whether a rounded box meets the strip from (x, y) to `front` ahead, `side` to either side."""
    half = 0.5 * front
    gap, _, _, _, _ = separation(x + half * c, y + half * s, c, s, half, side, 0.0, ox, oy, oc, os, a, b, r)
    return gap <= 0.0


@jit
def consider(
    n: int,
    pose: Numbers,
    build: Floats,
    ints: Ints,
    floats: Floats,
    ox: float,
    oy: float,
    oc: float,
    os: float,
    a: float,
    b: float,
    r: float,
) -> int:
    """Return the bits of `Workspace.held` that one body brings upon a car."""
    x, y, c, s = pose
    if not sees(x, y, c, s, floats[n, STOP], ox, oy, oc, os, a, b, r):
        return 0
    if ints[n, PATIENCE] < 0:
        return SEES
    bits = SEES
    front = build[HALF_LENGTH] + build[ROUNDING] + ELBOW + floats[n, SPEED] * build[PERIOD]
    side = build[HALF_WIDTH] + build[ROUNDING] + SHOULDER
    if in_way(x, y, c, s, front, side, ox, oy, oc, os, a, b, r):
        bits |= BARRED
    if build[HALF_LENGTH] > 0.0:
        px, py = nearest_in_box(x, y, ox, oy, oc, os, a, b)
        room = build[SPAN] - floats[n, STOP] + SHOULDER + r
        if (px - x) * (px - x) + (py - y) * (py - y) < room * room:
            bits |= TIGHT
    return bits


@jit
def look(
    state: State, b: int, build: Floats, ints: Ints, floats: Floats, obstacles: ObstacleTable, work: Workspace
) -> int:
    """Set `held` of each car of trial b by all that it sees.

    `build`, `ints` and `floats` are the trial's rows of `Agents`. Returns the number of pairs that had to be looked
    at; if it exceeds the room for pairs, nothing was decided.
    """
    span = build[SPAN]
    found = candidates(state, b, span, obstacles, span, work.pair, work.head, work.link, work.cell)
    if found > work.pair.shape[0]:
        return found
    for n in range(state.count[b]):
        work.held[n] = 0
    p = build[HALF_LENGTH]
    q = build[HALF_WIDTH]
    r = build[ROUNDING]
    for k in range(found):
        i = work.pair[k, 0]
        j = work.pair[k, 1]
        pose = (state.x[b, i], state.y[b, i], state.c[b, i], state.s[b, i])
        if j < 0:
            row = obstacles.part[-1 - j]
            work.held[i] |= consider(
                i, pose, build, ints, floats, row[0], row[1], row[2], row[3], row[4], row[5], row[6]
            )
            continue
        other = (state.x[b, j], state.y[b, j], state.c[b, j], state.s[b, j])
        for _ in range(2):
            if work.held[i] == 0 or ints[i, PATIENCE] >= 0:
                work.held[i] |= consider(
                    i, pose, build, ints, floats, other[0], other[1], other[2], other[3], p, q, r
                )
            i, j = j, i
            pose, other = other, pose
    return found
