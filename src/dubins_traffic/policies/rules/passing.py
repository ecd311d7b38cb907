"""Passing what stands in the lane, on the left, when the other lane is free (compiled)."""

from __future__ import annotations

from math import sqrt

import numpy as np

from dubins_traffic.cars.state import EGO
from dubins_traffic.cars.tables import ObstacleTable
from dubins_traffic.kernels.compile import jit, jit_inline, jit_rare
from dubins_traffic.policies.rules.abilities import PATIENT, turns_within_road
from dubins_traffic.policies.rules.narrow import BESIDE, EDGE, offset_on_way, within_lane
from dubins_traffic.policies.rules.tables import Traffic, Vehicle
from dubins_traffic.policies.rules.turn_arcs import ReferencePath
from dubins_traffic.policies.safety import GUARD, travel_of
from dubins_traffic.roads.lookup import INFINITE, lane_end
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.rules.shape import half_across

PASSING_WAIT = 2.0
"""Seconds to wait behind what stands before passing it."""
BERTH, WARY = 0.12, 0.02
"""Gap beside what is passed, metres; and the least beyond what a car that stands may get in a tick."""
SLIP = 0.25
"""A car begins to return this far past what it passes, metres, beyond the length of a rectangle."""
BACK = 0.4
"""Distance from there in which its body is back in the right lane, metres."""
STRAIGHT = 0.5
"""Before the end of a road the last metres outside the disc are straight (docs/rules.md#curves): at least so many,
beyond the reach of a body."""
TURNING = 1.2
"""Seconds that passing takes in addition to the time for the distance."""
COMES = 0.7
"""Least speed assumed of oncoming cars, m/s; if the cars can drive faster, that speed is assumed."""
SPARE = 0.6
"""Metres to spare before an oncoming car."""
FOLLOWED = 1.5
"""No e-agent begins to pass while the ego drives this near behind, metres: the ego might take its place."""
OVERTAKEN = 2.0
"""A car that comes from behind on the left within this distance is let past first, metres."""
NARROWS = 1.5
"""A body that stands this near behind what is passed is passed with it, metres."""


@jit_inline
def along(way: ReferencePath, x: float, y: float) -> float:
    """Return the coordinate of a point along the lane, from its end, metres, negative before it."""
    return (x - way.x) * way.tx + (y - way.y) * way.ty


@jit_inline
def aside(way: ReferencePath, x: float, y: float) -> float:
    """Return how far left of the middle of the right lane a point lies, metres."""
    return way.tx * (y - way.y) - way.ty * (x - way.x) + way.middle


@jit
def stop_line(vehicle: Vehicle) -> float:
    """Return where along the lane, metres from the intersection, negative, a car has to be back in it."""
    edge = vehicle.disc + vehicle.reach + 0.03
    return -sqrt(edge * edge - vehicle.middle * vehicle.middle)


@jit
def can_come_back(vehicle: Vehicle) -> bool:
    """Tell whether a car that has begun to pull out can still stay in its lane: it turns in place, or backs up."""
    return vehicle.tightest == 0.0 or (vehicle.slowest < 0.0 and turns_within_road(vehicle.tightest, vehicle.middle))


@jit_inline
def drawn_out(tight: float) -> float:
    """Return how many metres along an unrolled road a car may get on at most while it drives one, in its place aside.

    `tight` (ratio) is `Scratch.tight`; 1 on straight roads.
    """
    return (1.0 + tight) / max(1.0 - 2.0 * tight, 0.25)


@jit_inline
def slowed_by(tight: float) -> float:
    """Return how many metres a car may have to drive at most for one along an unrolled road.

    `tight` (ratio) is `Scratch.tight`.
    """
    return (1.0 + 2.0 * tight) / (1.0 - tight)


@jit_inline
def back_at(until: float, tight: float, vehicle: Vehicle) -> float:
    """Return where a car that begins to return at `until` (m) is in its lane again, metres from its end, negative.

    `tight` (ratio) is `Scratch.tight`. On the straight end of a road it needs no more than on a straight road.
    """
    straight = max(until, -(vehicle.disc + vehicle.reach + STRAIGHT))
    return min(until + BACK * drawn_out(tight), straight + BACK)


@jit_inline
def passing_time(here: float, until: float, tight: float, vehicle: Vehicle) -> float:
    """Return how long passing takes at most, seconds, from `here` (m) along the lane to where `until` (m) it returns.

    `tight` (ratio) is `Scratch.tight`.
    """
    if tight == 0.0:
        return (until + BACK - here) / (0.8 * vehicle.fastest) + TURNING
    return ((until - here) * slowed_by(tight) + BACK) / (0.8 * vehicle.fastest) + TURNING


@jit_rare
def find_way_past(b: int, n: int, way: ReferencePath, who: int, traffic: Traffic) -> None:
    """Begin to pass what stands ahead, if there is room to return and the other lane is and stays free."""
    state, labels, roads, obstacles, drivers, scratch = (
        traffic.state, traffic.labels, traffic.roads, traffic.obstacles, traffic.drivers, traffic.scratch,
    )  # fmt: skip
    vehicle = drivers.vehicle[b]
    car = drivers.car[b, n]
    reach = vehicle.reach
    here = along(way, state.x[b, n], state.y[b, n])
    end, offset, _ = extent(b, n, way, here, traffic, vehicle, drivers.car[b, n].lane)
    width = vehicle.half_width + vehicle.rounding
    offset += BERTH + width
    line = stop_line(vehicle)
    until = end + SLIP + 2.0 * vehicle.half_length
    tight = scratch.tight[0]
    back = back_at(until, tight, vehicle)
    if end < here or offset > 3.0 * vehicle.middle - EDGE or back > line or not can_come_back(vehicle):
        return
    net = drivers.net[b]
    length = roads.segment[int(roads.seg_off[net]) + (drivers.car[b, n].lane >> 1)].length
    if length + here < vehicle.disc + reach + EDGE:
        return
    if labels.bits[b, n] & FLAG.BLOCKED == 0 and not within_lane(offset, vehicle):
        return
    if stands_beside(b, here, back, offset, way, obstacles, vehicle):
        return
    crosses_over = n != EGO and not within_lane(offset, vehicle)
    if crosses_over and ego_is_beside(b, here, back, way, traffic, car.lane, vehicle):
        return
    time = passing_time(here, until, tight, vehicle)
    if time > vehicle.left_time:
        return
    comes = max(COMES, vehicle.fastest) * time * ((1.0 + tight) / (1.0 - tight)) + SPARE
    room = line - back
    j = scratch.head[drivers.car[b, n].lane >> 1]
    while j >= 0:
        key = along(way, float(state.x[b, j]), float(state.y[b, j]))
        left = aside(way, float(state.x[b, j]), float(state.y[b, j]))
        # An ego that stands may set off and bar the way back, which excuses nobody for long (E5).
        stands = labels.bits[b, j] & FLAG.STANDS != 0 and (n == EGO or j != EGO or key <= here)
        passes = labels.bits[b, j] & FLAG.LEFT != 0 and not stands
        if j != n and key > here - (OVERTAKEN if passes else 0.5):
            before = key > here or left > vehicle.middle
            wide = half_across(b, j, way.tx, way.ty, state, vehicle) + width + 0.1
            # Before an obstacle all go first in the other lane who are not blocked: who stands may come nearer.
            bars = (who < -1 and left > vehicle.middle) or abs(left - offset) < wide
            waits = stands and (who >= -1 or labels.bits[b, j] & FLAG.BLOCKED != 0)
            if before and bars and key < back + (0.5 if waits else comes):
                return
            if not stands and left < vehicle.middle:
                if key < end:
                    return
                room -= 2.0 * reach + BERTH
        j = scratch.link[j]
    if room < 0.0:
        return
    if -line - reach - vehicle.disc + (line - back) < comes and may_come(b, n, who, comes, way, traffic):
        return
    car.aside = offset
    car.until = until
    drivers.car[b, n].waited = 0


@jit_rare
def keep_off(b: int, n: int, p: int, way: ReferencePath, traffic: Traffic) -> None:
    """Begin to pass obstacles ahead without leaving the lane to the left, where no oncoming car is.

    All that are near to one another are passed on one line, or else obstacle part p, the first of them, alone.
    """
    state, obstacles, drivers = traffic.state, traffic.obstacles, traffic.drivers
    vehicle = drivers.vehicle[b]
    here = along(way, state.x[b, n], state.y[b, n])
    end, _, low = extent(b, n, way, here, traffic, vehicle, drivers.car[b, n].lane)
    offset = 0.0
    if end >= here and low > -INFINITE:
        offset = offset_on_way(b, way, here, end + SLIP, obstacles, vehicle)
    if offset == 0.0:
        part = obstacles.parts[p]
        end = along(way, part.x, part.y) + part.reach - vehicle.reach
        offset = offset_on_way(b, way, here + vehicle.reach, end, obstacles, vehicle)
    if end + 2.0 * vehicle.reach >= here and offset != 0.0:
        drivers.car[b, n].aside = offset
        drivers.car[b, n].until = end + SLIP + 2.0 * vehicle.half_length


@jit
def may_come(b: int, n: int, who: int, comes: float, way: ReferencePath, traffic: Traffic) -> bool:
    """Tell whether a car may come out of the next disc that is now at most `comes` metres behind it.

    An e-agent that has waited for long counts on those that stand before that disc to stand on, since they do not
    excuse it (docs/rules.md#lacks-room).
    """
    state, labels, roads, drivers, scratch = (
        traffic.state, traffic.labels, traffic.roads, traffic.drivers, traffic.scratch,
    )  # fmt: skip
    net = drivers.net[b]
    v = lane_end(roads, net, drivers.car[b, n].lane)
    row = int(roads.vert_off[net]) + v
    vehicle = drivers.vehicle[b]
    dares = n != EGO and drivers.car[b, n].waited * vehicle.period > PATIENT * vehicle.rest_time
    for k in range(roads.degree[row]):
        j = scratch.head[roads.arms[row, k] >> 1]
        while j >= 0:
            dx = state.x[b, j] - way.x
            dy = state.y[b, j] - way.y
            far = dx * dx + dy * dy >= (comes + 1.0) * (comes + 1.0)
            stands = labels.bits[b, j] & FLAG.STANDS != 0 and labels.crosses[b, j] < 0
            if j not in (n, who) and not far and not (dares and stands):
                inbound = labels.lane[b, j] < 0 or lane_end(roads, net, int(labels.lane[b, j])) == v
                if inbound and labels.segment[b, j] != drivers.car[b, n].lane >> 1:
                    return True
                if labels.crosses[b, j] == v:
                    return True
            j = scratch.link[j]
    return False


@jit_inline
def ego_is_beside(
    b: int, here: float, back: float, way: ReferencePath, traffic: Traffic, lane: int, vehicle: Vehicle
) -> bool:
    """Tell whether the ego is in the lane where car n, `here` (m) along its own, would pass.

    It might stay beside n, or stop where n returns, at `back` (m). One that stands behind n in its lane, or in the disc
    where that begins, does not count: until it has set off, n is ahead of it on the left.
    """
    state, labels = traffic.state, traffic.labels
    if labels.segment[b, EGO] != lane >> 1:
        return False
    key = along(way, state.x[b, EGO], state.y[b, EGO])
    left = aside(way, state.x[b, EGO], state.y[b, EGO])
    bits = np.int64(labels.bits[b, EGO])
    behind = labels.lane[b, EGO] == lane or labels.lane[b, EGO] < 0
    if key < here and behind and bits & (FLAG.STANDS | FLAG.LEFT) == FLAG.STANDS:
        return False
    return left < vehicle.middle and here - FOLLOWED < key < back + vehicle.backs_up + 2.0 * vehicle.reach + BERTH


@jit
def extent(
    b: int, n: int, way: ReferencePath, here: float, traffic: Traffic, vehicle: Vehicle, lane: int
) -> tuple[float, float, float]:
    """Return (end, left, right): where what stands ahead in the lane ends, and from where to where it reaches.

    Both are metres left of the middle of the lane, in which the car is at `here` (m); on the right nobody passes a car.
    Where ticks are long a car counts as wider: so much that a gap of `BERTH` beside it is safe whatever it does in a
    tick, however it turns meanwhile.
    """
    state, labels, obstacles, scratch = traffic.state, traffic.labels, traffic.obstacles, traffic.scratch
    end = here - 1.0
    offset = -1.0
    low = INFINITE
    reach = vehicle.reach
    wider = max(travel_of(vehicle) + GUARD + WARY - BERTH, 0.0)
    before = end - 1.0
    while end > before:
        before = end
        horizon = max(here, end) + NARROWS
        j = scratch.head[lane >> 1]
        while j >= 0:
            key = along(way, float(state.x[b, j]), float(state.y[b, j]))
            left = aside(way, float(state.x[b, j]), float(state.y[b, j]))
            if j != n and labels.bits[b, j] & FLAG.STANDS != 0 and here < key <= horizon and left < vehicle.middle:
                end = max(end, key)
                half = reach if wider > 0.0 else half_across(b, j, way.tx, way.ty, state, vehicle)
                offset = max(offset, left + half + wider)
                low = -INFINITE
            j = scratch.link[j]
        for p in range(obstacles.off[b], obstacles.off[b + 1]):
            part = obstacles.parts[p]
            key = along(way, part.x, part.y)
            left = aside(way, part.x, part.y)
            if here < key <= horizon + part.reach and abs(left) - part.reach < vehicle.middle:
                end = max(end, key + part.reach - reach)
                offset = max(offset, left + part.reach)
                low = min(low, left - part.reach)
    return end, offset, low


@jit
def stands_beside(
    b: int, here: float, back: float, offset: float, way: ReferencePath, obstacles: ObstacleTable, vehicle: Vehicle
) -> bool:  # fmt: skip
    """Tell whether an obstacle bars the way of a car from `here` (m) to `back` (m), `offset` (m) left of the middle."""
    wide = vehicle.half_width + vehicle.rounding + BESIDE
    for p in range(obstacles.off[b], obstacles.off[b + 1]):
        part = obstacles.parts[p]
        key = along(way, part.x, part.y)
        left = aside(way, part.x, part.y)
        near = here - vehicle.reach - part.reach < key < back + vehicle.reach + part.reach
        if near and left > 0.0 and abs(left - offset) < wide + part.reach:
            return True
    return False
