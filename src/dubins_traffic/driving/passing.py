"""Passing what stands in the lane, on the left, when the other lane is free (compiled)."""

from __future__ import annotations

from math import sqrt
from typing import Any

from dubins_traffic.cars.state import Labels, State
from dubins_traffic.cars.tables import ObstacleTable
from dubins_traffic.driving.law_tables import (
    ASIDE,
    DISC,
    HALF_WIDTH,
    LANE,
    MIDDLE,
    REACH,
    ROUNDING,
    SPEED,
    UNTIL,
    WAITED,
    Desk,
    Drivers,
)
from dubins_traffic.driving.turn_arcs import Way
from dubins_traffic.kernels.compile import jit, jit_inline
from dubins_traffic.roads.lookup import lane_end
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.spec.propositions import STANDS

PASSING_WAIT = 2.0
"""Seconds to wait behind what stands before passing it."""
BERTH = 0.12
"""What is kept free beside what stands, metres."""
SLIP = 0.25
"""So far past what stands a car begins to return, metres."""
BACK = 0.4
"""So far after that its body is back in the right lane, metres."""
TURNING = 1.2
"""Seconds that passing takes beyond what the distance asks for."""
SPARE = 0.6
"""Metres to spare before a car that comes."""
EDGE = 0.05
"""What the centre keeps from the edge of the road, metres."""


@jit_inline
def along(way: Way, x: float, y: float) -> float:
    """Return metres along the lane from its end, negative."""
    return (x - way.x) * way.tx + (y - way.y) * way.ty


@jit_inline
def aside(way: Way, x: float, y: float) -> float:
    """Return metres left of the middle of the right lane."""
    return way.tx * (y - way.y) - way.ty * (x - way.x) + way.middle


@jit
def find_way_past(
    b: int, n: int, way: Way, who: int, state: State, labels: Labels, roads: RoadTable,
    obstacles: ObstacleTable, drivers: Drivers, desk: Desk,
) -> None:  # fmt: skip
    """Begin to pass what stands ahead, if there is room to return and the other lane is and stays free."""
    build = drivers.build[b]
    floats = drivers.floats[b, n]
    reach = build[REACH]
    own = along(way, state.x[b, n], state.y[b, n])
    end, offset = extent(b, n, way, own, state, labels, obstacles, build, drivers.ints[b, n, LANE], desk)
    offset += BERTH + build[HALF_WIDTH] + build[ROUNDING]
    edge = build[DISC] + reach + 0.03
    line = -sqrt(edge * edge - build[MIDDLE] * build[MIDDLE])
    until = end + SLIP
    back = until + BACK
    if end < own or offset > 3.0 * build[MIDDLE] - EDGE or back > line:
        return
    time = (back - own) / (0.8 * floats[SPEED]) + TURNING
    comes = 0.7 * time + SPARE
    room = line - back
    j = desk.head[drivers.ints[b, n, LANE] >> 1]
    while j >= 0:
        key = along(way, float(state.x[b, j]), float(state.y[b, j]))
        left = aside(way, float(state.x[b, j]), float(state.y[b, j]))
        if j != n and key > own - 0.5:
            stands = labels.bits[b, j] & STANDS != 0
            if abs(left - offset) < 2.0 * reach + 0.1 and key < back + (0.5 if stands else comes):
                return
            if not stands and left < build[MIDDLE]:
                if key < end:
                    return
                room -= 2.0 * reach + BERTH
        j = desk.link[j]
    if room < 0.0:
        return
    net = drivers.net[b]
    v = lane_end(roads, net, drivers.ints[b, n, LANE])
    row = roads.vert_off[net] + v
    if -line - reach - build[DISC] + (line - back) < comes:
        for k in range(roads.degree[row]):
            j = desk.head[roads.arms[row, k] >> 1]
            while j >= 0:
                dx = state.x[b, j] - way.x
                dy = state.y[b, j] - way.y
                if j != n and dx * dx + dy * dy < (comes + 1.0) * (comes + 1.0) and j != who:
                    inbound = labels.lane[b, j] < 0 or lane_end(roads, net, int(labels.lane[b, j])) == v
                    if inbound and labels.segment[b, j] != drivers.ints[b, n, LANE] >> 1:
                        return
                    if labels.crosses[b, j] == v:
                        return
                j = desk.link[j]
    floats[ASIDE] = offset
    floats[UNTIL] = until
    drivers.ints[b, n, WAITED] = 0


@jit
def extent(
    b: int, n: int, way: Way, own: float, state: State, labels: Labels, obstacles: ObstacleTable, build: Any,
    lane: int, desk: Desk,
) -> tuple[float, float]:  # fmt: skip
    """Return (end, left): where what stands ahead in the lane ends, and how far left of its middle it reaches."""
    end = own - 1.0
    offset = -1.0
    reach = build[REACH]
    wide = build[HALF_WIDTH] + build[ROUNDING]
    for _ in range(3):
        horizon = max(own, end) + 1.5
        j = desk.head[lane >> 1]
        while j >= 0:
            key = along(way, float(state.x[b, j]), float(state.y[b, j]))
            left = aside(way, float(state.x[b, j]), float(state.y[b, j]))
            if j != n and labels.bits[b, j] & STANDS != 0 and own < key <= horizon and left < build[MIDDLE]:
                end = max(end, key)
                offset = max(offset, left + wide)
            j = desk.link[j]
        for p in range(obstacles.off[b], obstacles.off[b + 1]):
            row = obstacles.part[p]
            key = along(way, row[0], row[1])
            left = aside(way, row[0], row[1])
            if own < key <= horizon + row[7] and abs(left) - row[7] < build[MIDDLE]:
                end = max(end, key + row[7] - reach)
                offset = max(offset, left + row[7])
    return end, offset


@jit
def keep_passing(
    b: int, n: int, speed: float, way: Way, near: int, state: State, labels: Labels, obstacles: ObstacleTable,
    drivers: Drivers, desk: Desk,
) -> float:  # fmt: skip
    """Return the speed of a car that passes; end the manoeuvre when it is done or there is nothing left to pass."""
    build = drivers.build[b]
    floats = drivers.floats[b, n]
    own = along(way, state.x[b, n], state.y[b, n])
    left = aside(way, state.x[b, n], state.y[b, n])
    if own >= floats[UNTIL]:
        if abs(left) < 0.05:
            floats[ASIDE] = 0.0
        return speed
    length = 2.0 * build[REACH]
    for p in range(obstacles.off[b], obstacles.off[b + 1]):
        row = obstacles.part[p]
        key = along(way, row[0], row[1])
        if own - row[7] - length < key <= floats[UNTIL] + row[7] and abs(aside(way, row[0], row[1])) < 2.0:
            return speed
    beside = False
    before = False
    for k in range(near):
        j = desk.near[k]
        key = along(way, state.x[b, j], state.y[b, j])
        its = aside(way, state.x[b, j], state.y[b, j])
        if its > build[MIDDLE] or abs(its) > 2.0 * build[MIDDLE]:
            continue
        if labels.bits[b, j] & STANDS != 0 and own - length < key <= floats[UNTIL]:
            return speed
        if abs(key - own) < length + BERTH:
            beside = True
            before = before or key >= own - 0.1
    if not beside:
        floats[ASIDE] = 0.0
        return speed
    return 0.0 if before else speed
