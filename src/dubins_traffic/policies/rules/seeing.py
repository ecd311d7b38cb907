"""What is ahead of a car on its way, among the cars listed by segment, and the gap to keep from it (compiled)."""

from __future__ import annotations

from math import sqrt
from typing import Final, NamedTuple

import numpy as np

from dubins_traffic.cars.sensing import within_sight
from dubins_traffic.cars.state import EGO, Labels, State
from dubins_traffic.cars.tables import ObstacleTable
from dubins_traffic.kernels.compile import jit_inline, jit_rare
from dubins_traffic.policies.rules.narrow import EDGE
from dubins_traffic.policies.rules.tables import KIND, VIOLATION, Driver, Scratch, Traffic, Vehicle
from dubins_traffic.policies.rules.turn_arcs import PART, ReferencePath, on_way
from dubins_traffic.policies.safety import GUARD, travel_of
from dubins_traffic.roads.lookup import lane_end, lane_start
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.rules.shape import half_across

QUEUE_GAP = 0.12
"""Gap kept behind a car that waits, metres."""
MOVING_GAP = 0.25
"""Gap kept behind a car that drives, metres."""
STANDING_GAP, NEAR_ENOUGH = 0.72, 1.4
"""Gap kept behind what stands where there is room: enough to pull out, and for the e-agent of 2016 to drive off; and
the largest distance between centres, at which it still counts as blocking the lane, metres.
"""
FACING_GAP, BEYOND = 0.8, 0.02
"""Gap kept from an oncoming car, metres, by an ego even this much more if that car is left: nearer by it would count as
what keeps the car from going back (E5); a car on the left has to return, and goes closer."""
BRISK = 0.3
"""A car that leaves the crossing at least at this speed counts as making room, m/s; one that comes more slowly makes
nobody wait in a disc for it."""
OBSTACLE_GAP = 0.04
"""Gap kept in a disc from an obstacle behind the disc, metres: it never moves, and a car near it may then pass it."""
CLOSE_GAP = 0.06
"""Gap kept by a car that tailgates, metres."""
SIDE, NARROW = 0.04, 0.02
"""What is kept free beside the body along the way, metres; the same beside obstacles, which never move."""
BACKWARD = -0.9
"""Cosine of the angle between two lanes below which the way between them counts as turning round."""
HALF_TURN = 3.1
"""Length of the arc in which a car turns round, in units of its radius."""
HELD = 1e9
ABRUPT, ASTRAY = 0.8, 0.18
"""Sine of the angle at which a car returns to its way that is astray in a disc, having chosen another exit late, and
how far left of it such a car is, metres."""
EARLY = 0.8
"""A car leans from this gap to a body on, metres: beside it a rectangle would have no room to turn."""
AWARE = 0.06
"""A car takes note of bodies up to this much farther away than the gap it keeps, metres."""


class Beside(NamedTuple):
    """Where a body is beside a way: left of its middle, m, and the direction of the way there."""

    left: float
    px: float
    py: float


@jit_inline
def way_to_go(way: ReferencePath, x: float, y: float) -> float:
    """Return the coordinate of a point along the lane from the intersection at its end, metres, negative before it."""
    return (x - way.x) * way.tx + (y - way.y) * way.ty


@jit_inline
def alone(vehicle: Vehicle) -> float:
    """Return the distance of centres, metres, beyond which another car does not matter to one that just drives on."""
    widest = max(MOVING_GAP, STANDING_GAP, FACING_GAP)
    return 2.0 * vehicle.reach + widest + AWARE + vehicle.fastest * vehicle.period


@jit_inline
def corridor(left: float, wide: float) -> tuple[float, float]:
    """Return from where to where, left of the way, a car at `left` minds what is ahead: `wide` about it and the way."""
    return left - wide if left < 0.0 else -wide, left + wide if left > 0.0 else wide


@jit_inline
def meets_nobody(
    b: int, n: int, part: int, key: float, left: float, x: float, y: float, way: ReferencePath, state: State,
    vehicle: Vehicle,
) -> bool:  # fmt: skip
    """Tell whether no car of the trial is close to a car that just drives on, or ahead on its way, and no ego near."""
    far, touch = alone(vehicle), 2.0 * vehicle.reach + vehicle.near
    if leans(vehicle):
        touch = max(touch, leans_from(vehicle))
    low, high = corridor(left, 2.0 * (vehicle.half_width + vehicle.rounding) + SIDE)
    for j in range(state.count[b]):
        dx = state.x[b, j] - x
        dy = state.y[b, j] - y
        d2 = dx * dx + dy * dy
        if d2 > far * far or j == n:
            continue
        if j == EGO:
            return False
        there, its_key, its_left, _, _ = on_way(way, state.x[b, j], state.y[b, j])
        behind = there < part or (there == part and its_key <= key)
        if d2 < touch * touch or not (behind or its_left < low or its_left > high):
            return False
    return True


@jit_inline
def gather(b: int, n: int, lane: int, x: float, y: float, way: ReferencePath, traffic: Traffic) -> int:
    """List the cars on the car's segment, and on those that meet it where it is near an end; return how many."""
    labels, roads, drivers, scratch = traffic.labels, traffic.roads, traffic.drivers, traffic.scratch
    net = drivers.net[b]
    disc = drivers.vehicle[b].disc
    count = add_segment(labels.segment[b, n], n, 0, scratch)
    if labels.segment[b, n] != lane >> 1:
        count = add_segment(lane >> 1, n, count, scratch)
    to_go = -way_to_go(way, x, y)
    length = roads.segment[int(roads.seg_off[net]) + (lane >> 1)].length
    for end in range(2):
        far = to_go if end == 0 else length - to_go
        if far > disc + (1.0 if end == 0 else 0.8):
            continue
        v = lane_end(roads, net, lane) if end == 0 else lane_start(roads, net, lane)
        row = int(roads.vert_off[net]) + v
        for k in range(roads.degree[row]):
            segment = roads.arms[row, k] >> 1
            if segment != lane >> 1 and segment != labels.segment[b, n]:
                count = add_segment(int(segment), n, count, scratch)
    return count


@jit_inline
def add_segment(segment: int, n: int, count: int, scratch: Scratch) -> int:
    """Add the cars of a segment but n to `scratch.near`; return how many there are now."""
    other = scratch.head[segment]
    while other >= 0:
        if other != n:
            scratch.near[count] = other
            count += 1
        other = scratch.link[other]
    return count


@jit_inline
def look_ahead(
    b: int, n: int, part: int, key: float, left: float, x: float, y: float, way: ReferencePath, near: int,
    traffic: Traffic,
) -> tuple[float, int, bool]:  # fmt: skip
    """Return (gap, who, close): the first thing ahead on the way, and whether anything is close.

    `who` is a car, or -2 - p for obstacle part p. The gap to a car that `has_to_go_back` is less `FACING_GAP`.
    """
    state, labels, obstacles, scratch = traffic.state, traffic.labels, traffic.obstacles, traffic.scratch
    vehicle, car = traffic.drivers.vehicle[b], traffic.drivers.car[b, n]
    reach = vehicle.reach
    wide = 2.0 * (vehicle.half_width + vehicle.rounding) + SIDE
    low, high = corridor(left, wide)
    passing = car.aside != 0.0
    if passing and way_to_go(way, x, y) < car.until:
        on_right = car.aside < 0.0
        low = car.aside - wide if on_right else min(left, car.aside) - 0.1
        high = max(left, car.aside) + 0.1 if on_right else car.aside + wide
    gap = HELD
    who = -1
    close = False
    touch = 2.0 * reach + vehicle.near
    for k in range(near):
        j = scratch.near[k]
        dx = state.x[b, j] - x
        dy = state.y[b, j] - y
        d2 = dx * dx + dy * dy
        if d2 > vehicle.sight * vehicle.sight:
            continue
        if d2 < touch * touch:
            close = True
        there, its_key, its_left, px, py = on_way(way, state.x[b, j], state.y[b, j])
        if there < part or (there == part and its_key <= key) or its_left > high:
            continue
        if its_left < low and (j != EGO or its_left < low - wider(b, px, py, state, vehicle)):
            continue
        if left > ASTRAY and its_left > wide and comes_past(way, x, y, dx, dy, wide):
            continue
        beside = one_is_ego(j, n) or its_left > vehicle.middle
        if beside and leans_past(b, n, j, Beside(its_left, px, py), way, traffic):
            continue
        passed = car.aside > 0.0 and labels.bits[b, j] & FLAG.STANDS != 0
        if passed and its_left < car.aside - wide + SIDE:
            continue
        far = sqrt(d2)
        if there - part == 2:
            far = max(far, its_key - key + around(way))
        its_gap = far - 2.0 * reach
        if has_to_go_back(b, n, j, labels, car):
            its_gap -= FACING_GAP
        if its_gap < gap:
            gap = its_gap
            who = j
    return see_obstacles(b, part, key, x, y, way, low, high, gap, who, close, obstacles, vehicle, car)


@jit_rare
def wider(b: int, px: float, py: float, state: State, vehicle: Vehicle) -> float:
    """Return how much farther across a way with the direction (`px`, `py`) the ego reaches than along it, metres."""
    return half_across(b, EGO, px, py, state, vehicle) - vehicle.half_width - vehicle.rounding


@jit_rare
def comes_past(way: ReferencePath, x: float, y: float, dx: float, dy: float, wide: float) -> bool:
    """Tell whether a car at `x` (m), `y` (m), astray left of its way, comes back to it straight past a body beside it.

    The body's centre is `dx` (m) and `dy` (m) from the car's; past means at least `wide` (m) beside, or behind.
    """
    _, _, _, px, py = on_way(way, x, y)
    cosine = sqrt(1.0 - ABRUPT * ABRUPT)
    hx, hy = px * cosine + py * ABRUPT, py * cosine - px * ABRUPT
    return dx * hx + dy * hy <= 0.0 or abs(dx * hy - dy * hx) >= wide


@jit_rare
def leans_past(b: int, n: int, j: int, place: Beside, way: ReferencePath, traffic: Traffic) -> bool:
    """Tell whether car `n` gets past car `j` in a disc, at a `place` (m, direction) beside its way, by leaning.

    Two e-agents do so in bends and dead ends, where a tick is long. Who is clear of the other already drives on where
    that moves a little: it needs no more room than it keeps in a tick.
    """
    state, vehicle, left = traffic.state, traffic.drivers.vehicle[b], place.left
    if traffic.drivers.car[b, n].aside != 0.0 or traffic.labels.lane[b, j] >= 0:
        return False
    bend = is_in_bend(b, j, traffic)
    if not (one_is_ego(j, n) or (bend and leans(vehicle))):
        return False
    kept = half_across(b, j, place.px, place.py, state, vehicle) + kept_beside(vehicle)
    if is_clear_of(b, n, j, left, kept - SIDE, way, traffic):
        kept -= SIDE
    if left < 0.0:
        return left + kept <= farthest_left(vehicle)
    return left - kept >= farthest_right(way, state.x[b, j], state.y[b, j], bend and vehicle.tightest == 0.0)


@jit_inline
def is_clear_of(b: int, n: int, j: int, left: float, kept: float, way: ReferencePath, traffic: Traffic) -> bool:
    """Tell whether car `n` is near car `j`, which is `left` (m) of its way, and at least `kept` (m) beside it."""
    state, far = traffic.state, leans_from(traffic.drivers.vehicle[b])
    dx, dy = state.x[b, j] - state.x[b, n], state.y[b, j] - state.y[b, n]
    _, _, own, _, _ = on_way(way, state.x[b, n], state.y[b, n])
    return dx * dx + dy * dy <= far * far and abs(left - own) >= kept


@jit_inline
def one_is_ego(j: int, n: int) -> bool:
    """Tell whether one of two cars, j and n, is the ego."""
    return (j == EGO) != (n == EGO)


@jit_inline
def farthest_left(vehicle: Vehicle) -> float:
    """Return how far left of its lane's middle a car drives at most, metres: its body hardly comes over the line."""
    return vehicle.middle - vehicle.half_width - vehicle.rounding + vehicle.over


@jit_inline
def is_in_bend(b: int, n: int, traffic: Traffic) -> bool:
    """Tell whether a car's body meets the disc of a bend or dead end."""
    first, disc = int(traffic.roads.vert_off[traffic.drivers.net[b]]), int(traffic.labels.crosses[b, n])
    return disc >= 0 and int(traffic.roads.degree[first + disc]) < traffic.drivers.vehicle[b].degree


@jit_rare
def farthest_right(way: ReferencePath, x: float, y: float, around: bool) -> float:
    """Return the offset from its way, negative, at which a car beside a point, `x` (m), `y` (m), is at the road's edge.

    Outside a turn to the left the road reaches farther, if `around` (bool): in bends, for who turns in place. The inner
    corner of one to the right is nearer than the edge, up to where it is passed.
    """
    most = EDGE - way.middle
    part, _, _, px, py = on_way(way, x, y)
    if part != PART.THROUGH or (way.side > 0.0 and not around):
        return most
    if way.side < 0.0:
        # Beyond the corner the edge is along the lane out, at an angle of this cosine to the way.
        cosine = max(sqrt(0.5 + 0.5 * (way.ux * way.tx + way.uy * way.ty)), px * way.ux + py * way.uy)
        inner = (way.radius - way.middle) / cosine - way.radius + EDGE
        return max(most, inner) if way.radius > way.middle else most
    # The road's end is a disc about the intersection: from the centre of the arc it reaches so far in this direction.
    rx, ry = way.x - way.cx, way.y - way.cy
    along, across = py * rx - px * ry, px * rx + py * ry
    half2 = 4.0 * way.middle * way.middle - across * across
    return min(most, way.radius - along - sqrt(half2) + EDGE) if half2 > 0.0 else most


@jit_inline
def leans(vehicle: Vehicle) -> bool:
    """Tell whether a car in the middle of its lane can't pass one that reaches over the line as far as it may."""
    beside = vehicle.middle - vehicle.half_width - vehicle.rounding - vehicle.over
    return beside < travel_of(vehicle) + GUARD


@jit_inline
def leans_from(vehicle: Vehicle) -> float:
    """Return the distance of centres, metres, from which on a car leans past a body."""
    return 2.0 * vehicle.reach + EARLY


@jit_inline
def kept_beside(vehicle: Vehicle) -> float:
    """Return how far a car that leans keeps its centre from a body beside it, metres."""
    return vehicle.half_width + vehicle.rounding + travel_of(vehicle) + GUARD + SIDE


@jit_inline
def has_to_go_back(b: int, n: int, j: int, labels: Labels, car: Driver) -> bool:
    """Tell whether car `j` comes toward the ego n on the ego's side of the road (docs/rules.md#moving-up)."""
    its, ours = np.int64(labels.bits[b, j]), np.int64(labels.bits[b, n])
    comes = car.kind == KIND.ROUND and labels.lane[b, j] == car.lane ^ 1 and labels.crosses[b, n] < 0
    return comes and its & FLAG.LEFT != 0 and ours & FLAG.LEFT == 0


@jit_inline
def around(way: ReferencePath) -> float:
    """Return metres of the arc of a way that turns round, 0 of others."""
    return HALF_TURN * way.radius if way.tx * way.ux + way.ty * way.uy < BACKWARD else 0.0


@jit_inline
def chord(way: ReferencePath) -> float:
    """Return metres between the ends of the arc of a way: it is at least so long."""
    return way.radius * sqrt(2.0 * max(1.0 - way.tx * way.ux - way.ty * way.uy, 0.0))


@jit_inline
def see_obstacles(
    b: int, part: int, key: float, x: float, y: float, way: ReferencePath, low: float, high: float,
    gap: float, who: int, close: bool, obstacles: ObstacleTable, vehicle: Vehicle, car: Driver,
) -> tuple[float, int, bool]:  # fmt: skip
    """Return what `look_ahead` does, with regard for obstacles as well; each part counts as a disc about it."""
    wide = 2.0 * (vehicle.half_width + vehicle.rounding)
    for p in range(obstacles.off[b], obstacles.off[b + 1]):
        obstacle = obstacles.parts[p]
        dx = obstacle.x - x
        dy = obstacle.y - y
        d2 = dx * dx + dy * dy
        far = vehicle.sight + obstacle.reach
        if d2 > far * far:
            continue
        touch = vehicle.reach + obstacle.reach + vehicle.near
        if d2 < touch * touch:
            close = True
        there, its_key, its_left, _, _ = on_way(way, obstacle.x, obstacle.y)
        aside = obstacle.reach - vehicle.half_width - vehicle.rounding + NARROW - SIDE
        if there < part or (there == part and its_key <= key):
            continue
        if there > part and abs(its_left) > wide + SIDE + aside:
            continue
        if its_left < low - aside or its_left > high + aside:
            continue
        if car.aside > 0.0 and its_left < car.aside - wide - aside:
            continue
        distance = sqrt(d2)
        if there - part == 2:
            distance = max(distance, its_key - key + max(around(way), chord(way)))
        its_gap = distance - vehicle.reach - obstacle.reach
        if its_gap < gap:
            gap = its_gap
            who = -2 - p
    return gap, who, close


@jit_rare
def is_by_disc_behind(b: int, n: int, way: ReferencePath, traffic: Traffic) -> bool:
    """Tell whether a car is still so near to the disc at the beginning of its lane that it can't pull out."""
    drivers = traffic.drivers
    vehicle = drivers.vehicle[b]
    lane = drivers.car[b, n].lane
    length = traffic.roads.segment[int(traffic.roads.seg_off[drivers.net[b]]) + (lane >> 1)].length
    gone = length + way_to_go(way, traffic.state.x[b, n], traffic.state.y[b, n])
    return gone < vehicle.disc + vehicle.reach + EDGE + AWARE


@jit_inline
def wanted_gap(
    b: int, n: int, who: int, way: ReferencePath, traffic: Traffic, car: Driver, part: int, reach: float
) -> float:
    """Return the gap to keep from `who`."""
    state, labels = traffic.state, traffic.labels
    if who == -1:
        return 0.0
    # Inside a curve s, along the centre line, grows by more than the distance along the lane.
    near_enough = NEAR_ENOUGH * (1.0 - traffic.scratch.tight[0])
    standing = max(min(STANDING_GAP, near_enough - 2.0 * reach), QUEUE_GAP)
    if labels.bits[b, n] & FLAG.LEFT != 0:
        standing = QUEUE_GAP
    if who < -1:
        near = labels.crosses[b, n] >= 0 or is_by_disc_behind(b, n, way, traffic)
        return OBSTACLE_GAP if near else standing
    if has_to_go_back(b, n, who, labels, car):
        return BEYOND
    if car.violations & VIOLATION.TAILGATING != 0:
        return CLOSE_GAP
    its = np.int64(labels.bits[b, who])
    _, _, _, px, py = on_way(way, state.x[b, who], state.y[b, who])
    along = state.c[b, who] * px + state.s[b, who] * py
    ahead = labels.lane[b, who] == car.next_lane or labels.lane[b, who] == car.lane
    stands_facing = labels.crosses[b, n] >= 0 and (abs(state.speed[b, who]) < BRISK or ahead)
    if along < -0.3 and labels.crosses[b, who] < 0 and not stands_facing:
        return FACING_GAP if labels.bits[b, n] & FLAG.LEFT == 0 else MOVING_GAP
    in_disc = labels.crosses[b, n] >= 0
    waits = its & FLAG.EXCUSED != 0 or its & FLAG.APPROACH != 0
    if part == PART.BEFORE and labels.lane[b, who] != car.lane and traffic.drivers.way[b, n].crossing != 0:
        v = lane_end(traffic.roads, traffic.drivers.net[b], car.lane)
        # Nobody is passed in a crossing, and its line keeps a car far enough; into a bend the car would drive on.
        waits = waits or labels.crosses[b, who] == v
    if in_disc or waits:
        return QUEUE_GAP if abs(state.speed[b, who]) < 0.05 or in_disc else MOVING_GAP
    if its & FLAG.STANDS != 0 or (car.kind == KIND.ROUND and part == PART.BEFORE):
        return standing
    return QUEUE_GAP if abs(state.speed[b, who]) < 0.05 else MOVING_GAP


class _Listed(NamedTuple):
    """Which cars are in the lists of the segments."""

    NOBODY: int = 0
    SEEN: int = 1
    """All whom the ego sees."""
    ALL: int = 2


LISTED: Final = _Listed()


@jit_inline
def enlist(b: int, n: int, sight2: float, traffic: Traffic) -> None:
    """Fill the lists of the segments with the cars that car n takes into account: all, or those that the ego sees.

    `sight2` (m^2) is the square of how far the ego sees, negative if that is everywhere.
    """
    scratch = traffic.scratch
    if n > 0 and scratch.listed[0] == LISTED.SEEN:
        unlist_cars(b, traffic)
        scratch.listed[0] = LISTED.NOBODY
    if scratch.listed[0] == LISTED.NOBODY:
        hidden = list_cars(b, sight2 if n == 0 else -1.0, traffic)
        scratch.listed[0] = LISTED.SEEN if hidden > 0 else LISTED.ALL


@jit_inline
def list_cars(b: int, sight2: float, traffic: Traffic) -> int:
    """Enter the cars that the ego sees, by `sight2` (m^2; all if negative), in the lists of their segments.

    Returns how many it does not see.
    """
    state, labels, scratch = traffic.state, traffic.labels, traffic.scratch
    hidden = 0
    for n in range(state.count[b]):
        dx = state.x[b, n] - state.x[b, 0]
        dy = state.y[b, n] - state.y[b, 0]
        if not within_sight(dx, dy, sight2):
            hidden += 1
            continue
        scratch.link[n] = scratch.head[labels.segment[b, n]]
        scratch.head[labels.segment[b, n]] = n
    return hidden


@jit_inline
def unlist_cars(b: int, traffic: Traffic) -> None:
    """Empty the lists of the segments on which there are cars."""
    state, labels, scratch = traffic.state, traffic.labels, traffic.scratch
    for n in range(state.count[b]):
        scratch.head[labels.segment[b, n]] = -1
