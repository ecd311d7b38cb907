"""Cars that just drive on: what they do is kept, with the stretch of their way on which it is certain to stay so
(compiled).

Most cars have nothing around them and follow a lane or an arc. Of these only the offset from their line, and its
direction, change from tick to tick.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dubins_traffic.cars.state import Labels, State
from dubins_traffic.kernels.compile import jit_inline
from dubins_traffic.policies.rules.deferred import note
from dubins_traffic.policies.rules.path_cache import kept_way
from dubins_traffic.policies.rules.right_of_way import (
    GOES_NOW,
    count_turn,
    faces_gate,
    is_behind_ego,
    to_line,
)
from dubins_traffic.policies.rules.room import MARGIN
from dubins_traffic.policies.rules.seeing import meets_nobody, way_to_go
from dubins_traffic.policies.rules.steering import ASTRAY, slowed
from dubins_traffic.policies.rules.tables import (
    ALONE,
    APPROACHES,
    COAST_BEND,
    COAST_CROSSES,
    COAST_HIGH,
    COAST_LANE,
    COAST_LOW,
    COAST_PAST,
    COAST_SPEED,
    CROSSING,
    DISC,
    FASTEST,
    HOLD,
    KIND,
    LEFT_SIDE,
    LENGTH,
    OUT_LENGTH,
    PERIOD,
    REACH,
    ROLLING,
    ROUND,
    SPEED,
    THROUGH_SPEED,
    TIGHTEST,
    VIOLATIONS,
    WAITED,
    YAW_MOST,
    Drivers,
    Scratch,
)
from dubins_traffic.policies.rules.turn_arcs import AFTER, THROUGH, ReferencePath, in_arc, on_lane
from dubins_traffic.policies.safety import VERGE
from dubins_traffic.roads.lookup import CERTAIN
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.propositions import BLOCKED, LEFT, STOPPED

EVERYWHERE = 1e9
"""Metres that no way is long."""


@jit_inline
def coast(
    b: int, n: int, kind: int, company: int, state: State, labels: Labels, roads: RoadTable, drivers: Drivers,
    scratch: Scratch,
) -> bool:  # fmt: skip
    """Put off the command of a car that still just drives on as it did; tell whether it does.

    Nothing is around the car that matters to it, as far as `company` says so; else that is found here.
    """
    row = drivers.way[b, n]
    x, y = state.x[b, n], state.y[b, n]
    way = kept_way(row)
    dx, dy = x - way.cx, y - way.cy
    along = dx * way.tx + dy * way.ty
    past = dx * way.ux + dy * way.uy
    if not (row[COAST_LOW] < along < row[COAST_HIGH] and past < row[COAST_PAST]):
        return False
    changed = labels.lane[b, n] != row[COAST_LANE] or labels.crosses[b, n] != row[COAST_CROSSES]
    if changed or np.int64(labels.bits[b, n]) & (STOPPED | BLOCKED | LEFT) != 0:
        return False
    if kind == ROUND and not keeps_to_road(b, n, x, y, way, roads, drivers):
        return False
    bend = row[COAST_BEND]
    if bend == 0.0:
        part, key, left, px, py = on_lane(way, x, y)
    else:
        part, key, left, px, py = in_arc(way, dx, dy)
    if row[COAST_LANE] < 0.0 and left > ASTRAY:
        return False
    if company != ALONE and not meets_nobody(b, n, part, key, left, x, y, way, state, drivers.build[b]):
        return False
    note(b, n, row[COAST_SPEED], left, px, py, bend, state, scratch)
    return True


@jit_inline
def stop_coasting(row: Any) -> None:
    """Forget what a car did; `row` is its row of `Drivers.way`."""
    row[COAST_LOW] = EVERYWHERE


@jit_inline
def drive_on(
    b: int, n: int, part: int, left: float, px: float, py: float, outside: bool, way: ReferencePath, state: State,
    labels: Labels, roads: RoadTable, drivers: Drivers, scratch: Scratch,
) -> bool:  # fmt: skip
    """Put off the command of a car that just drives on, or waits at a line; tell whether it does, else do nothing.

    Nothing is around the car that matters to it (`policy.just_drives`). What it does is kept for the ticks to come.
    """
    build = drivers.build[b]
    ints = drivers.ints[b, n]
    row = drivers.way[b, n]
    x, y = state.x[b, n], state.y[b, n]
    bits = np.int64(labels.bits[b, n])
    special = bits & (BLOCKED | LEFT) != 0 or ints[VIOLATIONS] & LEFT_SIDE != 0
    if special or drivers.floats[b, n, HOLD] > 0.0 or build[TIGHTEST] > 0.0 or part == AFTER:
        return False
    if ints[KIND] == ROUND and not keeps_to_road(b, n, x, y, way, roads, drivers):
        return False
    speed = cruise(False, labels.crosses[b, n] >= 0, build, drivers.floats[b, n])
    bend = way.bend if part == THROUGH else 0.0
    gated = faces_gate(b, n, part, labels, roads, drivers)
    if labels.lane[b, n] < 0 and left > ASTRAY:
        return False
    if gated and ints[KIND] != ROUND and is_behind_ego(b, n, x, y, way, state, labels, drivers):
        return False
    line = to_line(left, x, y, way, build) if gated else EVERYWHERE
    if line < speed * build[PERIOD]:
        if row[CROSSING] == 0.0 or bits & GOES_NOW == GOES_NOW or ints[VIOLATIONS] & ROLLING != 0:
            return False
        speed = max(0.0, line) / build[PERIOD]
    else:
        keep_course(b, n, speed, part, outside, gated, x, y, way, labels, drivers)
    if gated:
        count_turn(bits, row, ints)
    ints[WAITED] = 0
    note(b, n, slowed(speed, bend, build[YAW_MOST]), left, px, py, bend, state, scratch)
    return True


@jit_inline
def keep_course(
    b: int, n: int, speed: float, part: int, outside: bool, gated: bool, x: float, y: float, way: ReferencePath,
    labels: Labels, drivers: Drivers,
) -> None:  # fmt: skip
    """Keep what a car does that has nothing around it, and on which stretch of its way it is certain to do the same.

    The stretch ends before the line at which the car may have to stop, for an e-agent that behind the ego. Without lane
    state it also ends where the arc does: there the part of the way changes, or the lane.
    """
    build = drivers.build[b]
    row = drivers.way[b, n]
    bend = way.bend if part == THROUGH else 0.0
    row[COAST_LOW] = 0.0 if part == THROUGH else -EVERYWHERE
    row[COAST_HIGH] = EVERYWHERE if outside or part == THROUGH else 0.0
    row[COAST_PAST] = EVERYWHERE if outside else 0.0
    if gated:
        along = (x - way.cx) * way.tx + (y - way.cy) * way.ty
        edge = build[DISC] + build[REACH] + MARGIN
        if drivers.ints[b, n, KIND] != ROUND:
            edge += build[APPROACHES]
        spare = -way_to_go(way, x, y) - edge - speed * build[PERIOD] - CERTAIN
        row[COAST_HIGH] = min(row[COAST_HIGH], along + spare)
    row[COAST_SPEED] = slowed(speed, bend, build[YAW_MOST])
    row[COAST_BEND] = bend
    row[COAST_LANE] = labels.lane[b, n]
    row[COAST_CROSSES] = labels.crosses[b, n]


@jit_inline
def cruise(hurries: bool, in_disc: bool, build: Any, floats: Any) -> float:
    """Return the speed at which a car drives if nothing is in its way."""
    speed = build[FASTEST] if hurries else floats[SPEED]
    if in_disc:
        speed = min(max(speed, build[THROUGH_SPEED]), build[FASTEST])
    return speed


@jit_inline
def keeps_to_road(
    b: int, n: int, x: float, y: float, way: ReferencePath, roads: RoadTable, drivers: Drivers
) -> bool:
    """Tell whether a car is certain to keep VERGE from the edge of the road for a tick, whatever it does.

    It is so near to the lane it is on, to the next one, or to the intersection between, that it can't get so far from
    it in a tick.
    """
    build = drivers.build[b]
    row = drivers.way[b, n]
    travel = build[FASTEST] * build[PERIOD]
    room = max(roads.half_width[drivers.net[b]] - VERGE - travel - CERTAIN, 0.0)
    rx, ry = x - way.x, y - way.y
    to_go = -(rx * way.tx + ry * way.ty)
    since = rx * way.ux + ry * way.uy
    before = 0.0 < to_go < row[LENGTH] and abs(way.tx * ry - way.ty * rx) < room
    behind = 0.0 < since < row[OUT_LENGTH] and abs(way.ux * ry - way.uy * rx) < room
    return before or behind or rx * rx + ry * ry < room * room
