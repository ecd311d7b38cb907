"""Cars that just drive on: what they do is kept, with a rectangle in which it is certain to stay so (compiled).

Most cars have nothing around them and follow a lane or an arc. Of these only the offset from their line, and its
direction, change from tick to tick.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dubins_traffic.cars.state import Labels, State
from dubins_traffic.driving.gates import MARGIN
from dubins_traffic.driving.kept_ways import kept_way
from dubins_traffic.driving.law_tables import (
    COAST_BEND,
    COAST_CROSSES,
    COAST_HIGH_X,
    COAST_HIGH_Y,
    COAST_LANE,
    COAST_LOW_X,
    COAST_LOW_Y,
    COAST_SPEED,
    DISC,
    FASTEST,
    HOLD,
    KIND,
    LANE,
    LEFT_SIDE,
    LENGTH,
    MIDDLE,
    MOOD,
    PERIOD,
    REACH,
    ROUND,
    TIGHTEST,
    Desk,
    Drivers,
)
from dubins_traffic.driving.safety import VERGE
from dubins_traffic.driving.seeing import way_to_go
from dubins_traffic.driving.turn_arcs import BEFORE, THROUGH, Way, in_arc, on_lane
from dubins_traffic.kernels.compile import jit_inline
from dubins_traffic.roads.lookup import CERTAIN, lane_end
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.spec.propositions import BLOCKED, LEFT, STOPPED

FARTHEST = 100.0
"""Metres up to which a place is said to be far from any that matters."""


@jit_inline
def coast(b: int, n: int, state: State, labels: Labels, drivers: Drivers, desk: Desk) -> bool:
    """Put off the command of a car that still just drives on as it did; tell whether it does.

    Nothing is around the car that matters to it.
    """
    row = drivers.way[b, n]
    x, y = state.x[b, n], state.y[b, n]
    if not (row[COAST_LOW_X] < x < row[COAST_HIGH_X] and row[COAST_LOW_Y] < y < row[COAST_HIGH_Y]):
        return False
    changed = labels.lane[b, n] != row[COAST_LANE] or labels.crosses[b, n] != row[COAST_CROSSES]
    if changed or np.int64(labels.bits[b, n]) & (STOPPED | BLOCKED | LEFT) != 0:
        return False
    way = kept_way(row)
    bend = row[COAST_BEND]
    if bend == 0.0:
        _, _, left, px, py = on_lane(way, x, y)
    else:
        _, _, left, px, py = in_arc(way, x - way.cx, y - way.cy)
    note(n, row[COAST_SPEED], left, px, py, bend, desk)
    return True


@jit_inline
def note(n: int, speed: float, left: float, px: float, py: float, bend: float, desk: Desk) -> None:
    """Leave the command of a car to `steering.catch_up`."""
    late = desk.late[n]
    late[0] = 1.0
    late[1] = speed
    late[2] = left
    late[3] = px
    late[4] = py
    late[5] = bend


@jit_inline
def stop_coasting(row: Any) -> None:
    """Forget what a car did; `row` is its row of `Drivers.way`."""
    row[COAST_HIGH_X] = row[COAST_LOW_X]


@jit_inline
def begin_coasting(
    b: int, n: int, speed: float, part: int, left: float, outside: bool, x: float, y: float, way: Way,
    labels: Labels, roads: RoadTable, drivers: Drivers,
) -> None:  # fmt: skip
    """Keep what a car does that has nothing around it, and where it is certain to do the same.

    One on its round, which looks at the edges of the road, is followed on its lane only.
    """
    ints = drivers.ints[b, n]
    build = drivers.build[b]
    row = drivers.way[b, n]
    if ints[MOOD] & LEFT_SIDE != 0 or drivers.floats[b, n, HOLD] > 0.0 or build[TIGHTEST] > 0.0:
        return
    spare = FARTHEST
    if ints[KIND] == ROUND:
        if part != BEFORE:
            return
        to_go = -way_to_go(way, x, y)
        edge = roads.half_width[drivers.net[b]] - VERGE - abs(left - build[MIDDLE])
        spare = min(edge, to_go, row[LENGTH] - to_go) - build[FASTEST] * build[PERIOD] - CERTAIN
    if not outside:
        rx, ry = x - way.cx, y - way.cy
        along = rx * way.tx + ry * way.ty
        past = rx * way.ux + ry * way.uy
        spare = min(along if part == THROUGH else -along, -past)
    if part == BEFORE and labels.crosses[b, n] != lane_end(roads, drivers.net[b], ints[LANE]):
        edge = build[DISC] + build[REACH] + MARGIN
        spare = min(spare, -way_to_go(way, x, y) - edge - speed * build[PERIOD])
    half = 0.7 * spare - CERTAIN
    row[COAST_LOW_X] = x - half
    row[COAST_HIGH_X] = x + half
    row[COAST_LOW_Y] = y - half
    row[COAST_HIGH_Y] = y + half
    row[COAST_SPEED] = speed
    row[COAST_BEND] = way.bend if part == THROUGH else 0.0
    row[COAST_LANE] = labels.lane[b, n]
    row[COAST_CROSSES] = labels.crosses[b, n]
