"""The law of the road, compiled: one tick of all cars that keep the rules, e-agents and the ego alike.

A car drives its way (`driving.turn_arcs`) in the right lane, stops before every disc that it may not enter, keeps
behind what is ahead, and passes what stands (`driving.passing`). It enters a crossing only on its turn, as its
propositions tell, and any disc only if there is room behind it: so no disc is ever blocked by a queue. A last look
before every tick rules out all motions that could bring about a contact, whatever the others do.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from dubins_traffic.cars.state import Labels, State
from dubins_traffic.cars.tables import ObstacleTable
from dubins_traffic.driving.exits import count_visit, take_lane, ticks_of, watch_ego
from dubins_traffic.driving.gates import TRAIL, mind_gate, turn_elsewhere
from dubins_traffic.driving.lane_graph import lane_at
from dubins_traffic.driving.law_tables import (
    ABSENT,
    ASIDE,
    DISC,
    FASTEST,
    HALF_LENGTH,
    HALF_WIDTH,
    HOLD,
    KIND,
    LANE,
    LEFT_SIDE,
    MIDDLE,
    MOOD,
    NEMESIS,
    NEXT,
    PERIOD,
    REACH,
    ROUND,
    ROUNDING,
    SLOWEST,
    SPEED,
    TAILGATING,
    THROUGH_SPEED,
    TIGHTEST,
    UNTIL,
    WAITED,
    YAW_MOST,
    Desk,
    Drivers,
)
from dubins_traffic.driving.passing import PASSING_WAIT, find_way_past, keep_passing, stays_right
from dubins_traffic.driving.safety import VERGE, leaves_road, motion_is_safe
from dubins_traffic.driving.seeing import QUEUE_GAP, gather, look_ahead, wanted_gap, way_to_go
from dubins_traffic.driving.turn_arcs import AFTER, BEFORE, THROUGH, Way, on_lane, on_way, way_between
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.compile import jit, jit_inline, jit_inner
from dubins_traffic.roads.lookup import lane_end, lane_start
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.spec.propositions import BLOCKED, LEFT

STUCK = 2.0
"""Seconds for which an e-agent in a disc waits for the way it wants before it takes another; of the ego that is not
asked, and on its way to another exit it might leave the disc outside its lane."""
BUMPER = 0.005
"""Gap kept behind a moving car by one that tailgates and trusts it not to brake, metres."""
PRESSED = 0.4
"""Who has a car in the disc behind it so close, metres, closes up, so that it can leave the disc."""
DAWDLE = 0.12
"""Speed of a nemesis before the ego, m/s."""
HURRY = 0.25
"""Metres in which a car returns to its way."""
SLANT, STEEP = 0.7, 0.9
"""Sine of the largest angle to its way at which a car drives; the same when it pulls out, or has to return."""
ALIGNED, NIMBLE = 0.8, 0.98
"""Cosine of the angle to where it should head beyond which a car turns in place; the same when it pulls out."""
GAIN = 8.0
"""Yaw rate for each unit of the sine of that angle, 1/s."""


@jit
def decide(
    tick: int,
    state: State,
    labels: Labels,
    roads: RoadTable,
    obstacles: ObstacleTable,
    drivers: Drivers,
    desk: Desk,
    commands: Floats,
) -> None:
    """Write the commands of all cars that the law drives."""
    for b in range(drivers.active.shape[0]):
        if drivers.active[b] != 0:
            decide_trial(b, tick, -1.0, state, labels, roads, obstacles, drivers, desk, commands)


@jit_inner
def decide_trial(
    b: int, tick: int, sight2: float, state: State, labels: Labels, roads: RoadTable,
    obstacles: ObstacleTable, drivers: Drivers, desk: Desk, commands: Floats,
) -> None:  # fmt: skip
    """Write the commands of the cars of one trial that the law drives.

    The ego goes by the cars whose squared distance from it is at most `sight2`, metres squared, and by all that are
    given if that is negative.
    """
    hidden = list_cars(b, sight2, state, labels, desk)
    for n in range(state.count[b]):
        if n == 1 and hidden > 0:
            unlist_cars(b, state, labels, desk)
            list_cars(b, -1.0, state, labels, desk)
        if drivers.ints[b, n, KIND] != ABSENT:
            speed, yaw_rate = drive(b, n, tick, state, labels, roads, obstacles, drivers, desk)
            commands[b, n, 0] = speed
            commands[b, n, 1] = yaw_rate
    unlist_cars(b, state, labels, desk)


@jit_inline
def list_cars(b: int, sight2: float, state: State, labels: Labels, desk: Desk) -> int:
    """Enter the cars that the ego sees (all if `sight2` is negative) in the lists of their segments.

    Returns how many it does not see.
    """
    hidden = 0
    for n in range(state.count[b]):
        dx = state.x[b, n] - state.x[b, 0]
        dy = state.y[b, n] - state.y[b, 0]
        if sight2 >= 0.0 and dx * dx + dy * dy > sight2:
            hidden += 1
            continue
        desk.link[n] = desk.head[labels.segment[b, n]]
        desk.head[labels.segment[b, n]] = n
    return hidden


@jit_inline
def unlist_cars(b: int, state: State, labels: Labels, desk: Desk) -> None:
    """Empty the lists of the segments on which there are cars."""
    for n in range(state.count[b]):
        desk.head[labels.segment[b, n]] = -1


@jit_inline
def drive(
    b: int, n: int, tick: int, state: State, labels: Labels, roads: RoadTable, obstacles: ObstacleTable,
    drivers: Drivers, desk: Desk,
) -> tuple[float, float]:  # fmt: skip
    """Return the command of a car."""
    net = drivers.net[b]
    build = drivers.build[b]
    ints = drivers.ints[b, n]
    floats = drivers.floats[b, n]
    x, y, c, s = state.x[b, n], state.y[b, n], state.c[b, n], state.s[b, n]
    if ints[KIND] == ROUND:
        count_visit(b, n, labels, drivers)
    elif ints[KIND] == NEMESIS:
        watch_ego(b, n, labels, drivers)
    way = keep_place(b, n, tick, x, y, c, s, state, labels, roads, drivers, desk)
    part, key, left, px, py = on_way(way, x, y)
    outside = labels.lane[b, n] == ints[LANE]
    if outside and part != BEFORE:
        part, key, left, px, py = on_lane(way, x, y)
    near = gather(b, n, ints[LANE], x, y, way, labels, roads, drivers, desk)
    gap, who, close = look_ahead(
        b, part, key, left, x, y, way, near, state, labels, obstacles, build, floats, desk
    )
    rides = ints[MOOD] & TAILGATING != 0 and outside and who >= 0 and labels.lane[b, who] == ints[LANE]
    passes = floats[ASIDE] != 0.0
    speed = build[FASTEST] if rides or passes else floats[SPEED]
    if labels.crosses[b, n] >= 0:
        speed = min(max(speed, build[THROUGH_SPEED]), build[FASTEST])
    speed = mind_gate(b, n, tick, speed, part, left, x, y, way, near, state, labels, roads, drivers, desk)
    kept = BUMPER if rides else wanted_gap(b, n, who, way, state, labels, ints, part, build[REACH])
    behind = who >= 0 and labels.lane[b, who] == ints[LANE] and kept > QUEUE_GAP
    if behind and is_pressed(b, n, near, state, labels, roads, drivers, desk):
        kept = QUEUE_GAP
    ahead = max(0.0, state.speed[b, who]) if rides else 0.0
    speed = min(speed, max(0.0, gap - kept) / build[PERIOD] + ahead)
    if ints[KIND] == NEMESIS and not passes and before_ego(b, n, near, state, labels, roads, drivers, desk):
        speed = min(speed, DAWDLE)
    if floats[HOLD] > 0.0 and labels.at[b, n] == lane_end(roads, net, ints[LANE]):
        floats[HOLD] -= build[PERIOD]
        speed = 0.0
    speed, offset = pass_what_stands(
        b, n, speed, gap, kept, who, part, outside, way, near, state, labels, roads, obstacles, drivers, desk
    )
    if part != BEFORE and ints[WAITED] > ticks_of(STUCK, build) and ints[KIND] != ROUND:
        turn_elsewhere(b, n, tick, state, labels, roads, drivers, desk)
    trusted = who if rides else -1
    speed, yaw_rate = move(
        b, n, speed, left, offset, px, py, part, outside, way, near if close else 0, trusted, state, labels,
        obstacles, drivers, desk,
    )  # fmt: skip
    if speed != 0.0 and ints[KIND] == ROUND:
        edge = float(roads.half_width[net]) - VERGE
        if leaves_road(x, y, c, s, speed, yaw_rate, build[PERIOD], edge, roads, net):
            speed = 0.0
    return speed, yaw_rate


@jit_inline
def move(
    b: int, n: int, allowed: float, left: float, offset: float, px: float, py: float, part: int, outside: bool,
    way: Way, near: int, trusted: int, state: State, labels: Labels, obstacles: ObstacleTable,
    drivers: Drivers, desk: Desk,
) -> tuple[float, float]:  # fmt: skip
    """Return the command that leads to the line `offset` to the left of the way, if it is safe and lawful."""
    build = drivers.build[b]
    c, s = state.c[b, n], state.s[b, n]
    passes = drivers.floats[b, n, ASIDE] != 0.0
    steep = STEEP if passes or np.int64(labels.bits[b, n]) & LEFT != 0 else SLANT
    aligned = NIMBLE if passes and left < offset else ALIGNED
    speed, yaw_rate = steer(c, s, left - offset, px, py, part, way, allowed, steep, aligned, build)
    if passes or build[TIGHTEST] > 0.0:
        speed, yaw_rate = keep_right(
            b, n, speed, yaw_rate, outside, way, state, labels, obstacles, drivers, desk
        )
    safe = is_safe(b, n, speed, yaw_rate, near, trusted, state, obstacles, build, desk)
    if not safe and passes and offset == 0.0:
        speed, yaw_rate = steer(c, s, 0.0, px, py, part, way, allowed, steep, aligned, build)
        safe = is_safe(b, n, speed, yaw_rate, near, trusted, state, obstacles, build, desk)
    if not safe:
        speed = 0.0
        if build[HALF_LENGTH] > 0.0 and not is_safe(
            b, n, speed, yaw_rate, near, trusted, state, obstacles, build, desk
        ):
            yaw_rate = 0.0
    return speed, yaw_rate


@jit_inline
def pass_what_stands(
    b: int, n: int, speed: float, gap: float, kept: float, who: int, part: int, outside: bool, way: Way,
    near: int, state: State, labels: Labels, roads: RoadTable, obstacles: ObstacleTable, drivers: Drivers,
    desk: Desk,
) -> tuple[float, float]:  # fmt: skip
    """Return (speed, offset to the left of the way): of a car that drives on the left, or passes, or waits to."""
    build = drivers.build[b]
    ints = drivers.ints[b, n]
    floats = drivers.floats[b, n]
    bits = np.int64(labels.bits[b, n])
    offset = 2.0 * build[MIDDLE] if ints[MOOD] & LEFT_SIDE != 0 and outside else 0.0
    stubborn = part == THROUGH or who < 0 or bits & BLOCKED != 0 or offset != 0.0
    ints[WAITED] = ints[WAITED] + 1 if stubborn and gap < kept + 0.05 else 0
    if offset != 0.0 and ints[WAITED] > ticks_of(STUCK, build):
        ints[MOOD] &= ~LEFT_SIDE
    if not outside:
        floats[ASIDE] = 0.0
    elif floats[ASIDE] != 0.0:
        speed = keep_passing(b, n, speed, way, near, state, labels, obstacles, drivers, desk)
        offset = floats[ASIDE] if way_to_go(way, state.x[b, n], state.y[b, n]) < floats[UNTIL] else 0.0
    elif (bits & BLOCKED != 0 or who < -1) and waited_long(ints, bits, build):
        find_way_past(b, n, way, who, state, labels, roads, obstacles, drivers, desk)
    return speed, offset


@jit_inline
def is_pressed(
    b: int, n: int, near: int, state: State, labels: Labels, roads: RoadTable, drivers: Drivers, desk: Desk
) -> bool:  # fmt: skip
    """Tell whether a car close behind is still in the disc at the beginning of the lane, and needs room to leave it."""
    v = lane_start(roads, drivers.net[b], drivers.ints[b, n, LANE])
    far = 2.0 * drivers.build[b, REACH] + PRESSED
    if labels.crosses[b, n] >= 0:
        return False
    for k in range(near):
        j = desk.near[k]
        dx = state.x[b, j] - state.x[b, n]
        dy = state.y[b, j] - state.y[b, n]
        if labels.crosses[b, j] == v and dx * dx + dy * dy < far * far:
            return True
    return False


@jit_inline
def waited_long(ints: Any, bits: Any, build: Any) -> bool:
    """Tell whether it is time to look for a way past: not in every tick, and sooner for who is left already."""
    return (ints[WAITED] >= ticks_of(PASSING_WAIT, build) or bits & LEFT != 0) and ints[WAITED] % 4 == 0


@jit_inline
def keep_right(
    b: int, n: int, speed: float, yaw_rate: float, outside: bool, way: Way, state: State, labels: Labels,
    obstacles: ObstacleTable, drivers: Drivers, desk: Desk,
) -> tuple[float, float]:  # fmt: skip
    """Return a command that does not make the car left without a reason: it waits, or backs up into its lane."""
    build = drivers.build[b]
    bits = np.int64(labels.bits[b, n])
    lawless = drivers.ints[b, n, MOOD] & LEFT_SIDE != 0
    if lawless or speed == 0.0 or not outside or bits & LEFT != 0 or stays_right(
        b, n, speed, yaw_rate, way, state, labels, obstacles, drivers, desk
    ):  # fmt: skip
        return speed, yaw_rate
    leans = way.tx * state.s[b, n] - way.ty * state.c[b, n] > 0.0
    if drivers.floats[b, n, ASIDE] != 0.0 or not leans or build[SLOWEST] >= 0.0:
        return 0.0, 0.0
    speed = min(speed, -build[SLOWEST])
    return -speed, -min(speed / build[TIGHTEST], build[YAW_MOST])


@jit_inline
def keep_place(
    b: int, n: int, tick: int, x: float, y: float, c: float, s: float, state: State, labels: Labels,
    roads: RoadTable, drivers: Drivers, desk: Desk,
) -> Way:  # fmt: skip
    """Keep LANE and NEXT in step with where the car is; return its way."""
    net = drivers.net[b]
    build = drivers.build[b]
    ints = drivers.ints[b, n]
    seen = labels.lane[b, n]
    if ints[LANE] < 0:
        lane = seen if seen >= 0 else lane_at(roads, net, x, y, c, s)
        take_lane(b, n, tick, lane, state, labels, roads, drivers, desk)
    elif seen >= 0 and seen != ints[LANE]:
        take_lane(b, n, tick, seen, state, labels, roads, drivers, desk)
    way = way_between(roads, net, ints[LANE], ints[NEXT], build[MIDDLE], build[DISC])
    if seen < 0 and (x - way.x) * way.tx + (y - way.y) * way.ty > -1.5 * build[DISC]:
        part, _, _, _, _ = on_way(way, x, y)
        if part == AFTER:
            take_lane(b, n, tick, ints[NEXT], state, labels, roads, drivers, desk)
            way = way_between(roads, net, ints[LANE], ints[NEXT], build[MIDDLE], build[DISC])
    return way


@jit_inline
def before_ego(
    b: int, n: int, near: int, state: State, labels: Labels, roads: RoadTable, drivers: Drivers, desk: Desk
) -> bool:
    """Tell whether the ego comes behind a nemesis outside the discs, and no other car has to get out of a disc."""
    net = drivers.net[b]
    lane = labels.lane[b, n]
    if lane < 0 or labels.crosses[b, n] >= 0:
        return False
    dx = state.x[b, 0] - state.x[b, n]
    dy = state.y[b, 0] - state.y[b, n]
    if dx * dx + dy * dy > TRAIL * TRAIL:
        return False
    v = lane_start(roads, net, lane)
    for k in range(near):
        if desk.near[k] != 0 and labels.crosses[b, desk.near[k]] == v:
            return False
    its = labels.lane[b, 0]
    behind = dx * state.c[b, n] + dy * state.s[b, n] < 0.0
    comes = its >= 0 and lane_end(roads, net, its) == v
    return behind and (its == lane or comes or labels.crosses[b, 0] == v)


@jit_inline
def steer(
    c: float, s: float, left: float, px: float, py: float, part: int, way: Way, speed: float,
    most: float, aligned: float, build: Any,
) -> tuple[float, float]:  # fmt: skip
    """Return (speed, yaw rate) of a car `left` of the line it should drive, whose direction is (px, py).

    `most` is the sine of the largest angle to that line, `aligned` the cosine beyond which the car turns in place.
    """
    sine = min(max(-left / HURRY, -most), most)
    cosine = sqrt(1.0 - sine * sine)
    hx = px * cosine - py * sine
    hy = py * cosine + px * sine
    cross = c * hy - s * hx
    dot = c * hx + s * hy
    limit = build[YAW_MOST]
    if dot < aligned and build[TIGHTEST] == 0.0:
        turn = limit
        if dot > 0.0:
            turn = min(limit, abs(cross) / build[PERIOD])
        return 0.0, turn if cross >= 0.0 else -turn
    bend = way.side / way.radius if part == THROUGH else 0.0
    if abs(bend) * speed > 0.8 * limit:
        speed = 0.8 * limit / abs(bend)
    if speed == 0.0:
        return 0.0, 0.0
    yaw_rate = speed * bend + GAIN * cross
    if build[TIGHTEST] > 0.0:
        limit = min(limit, speed / build[TIGHTEST])
        if dot < 0.0:
            yaw_rate = limit if cross >= 0.0 else -limit
    return speed, min(max(yaw_rate, -limit), limit)


@jit
def is_safe(
    b: int, n: int, speed: float, yaw_rate: float, near: int, trusted: int, state: State,
    obstacles: ObstacleTable, build: Any, desk: Desk,
) -> bool:  # fmt: skip
    """Tell whether a command can't bring about a contact, whatever the others but `trusted` do in this tick."""
    x, y, c, s = state.x[b, n], state.y[b, n], state.c[b, n], state.s[b, n]
    period = build[PERIOD]
    p, q, r, reach = build[HALF_LENGTH], build[HALF_WIDTH], build[ROUNDING], build[REACH]
    travel = build[FASTEST] * period
    if p > 0.0:
        travel += build[YAW_MOST] * reach * period
    for k in range(near):
        j = desk.near[k]
        dx = state.x[b, j] - x
        dy = state.y[b, j] - y
        far = 2.0 * reach + 0.2
        if j != trusted and dx * dx + dy * dy < far * far and not motion_is_safe(
            x, y, c, s, speed, yaw_rate, period, p, q, r, reach,
            state.x[b, j], state.y[b, j], state.c[b, j], state.s[b, j], p, q, r, travel,
        ):  # fmt: skip
            return False
    for k in range(obstacles.off[b], obstacles.off[b + 1]):
        row = obstacles.part[k]
        dx = row[0] - x
        dy = row[1] - y
        far = reach + row[7] + 0.2
        if dx * dx + dy * dy < far * far and not motion_is_safe(
            x, y, c, s, speed, yaw_rate, period, p, q, r, reach,
            row[0], row[1], row[2], row[3], row[4], row[5], row[6], 0.0,
        ):  # fmt: skip
            return False
    return True
