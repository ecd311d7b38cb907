"""The command cache: what cars without anything around them do, and the stretch on which that is valid (compiled).

Most cars have nothing around them and follow a lane or an arc: only their offset from its line, and their direction,
change from tick to tick. What they do stands in columns (`kept.KeptCommands`), so that the commands of several cars are
computed at once.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from dubins_traffic.cars.clip_and_move import TOGETHER, copy_together
from dubins_traffic.cars.state import State
from dubins_traffic.kernels.arrays import BLOCK, WIDE, Floats
from dubins_traffic.kernels.compile import jit, jit_inline, jit_look
from dubins_traffic.policies.rules.choice import keeps_exit
from dubins_traffic.policies.rules.kept import NOWHERE, KeptCommands, KeptPath
from dubins_traffic.policies.rules.right_of_way import (
    GOES_NOW,
    count_turn,
    faces_gate,
    is_behind_ego,
    to_line,
)
from dubins_traffic.policies.rules.room import MARGIN, queue_lengths
from dubins_traffic.policies.rules.seeing import meets_nobody, way_to_go
from dubins_traffic.policies.rules.steering import ALIGNED, ASTRAY, SLANT, follow_line, slowed, steer
from dubins_traffic.policies.rules.tables import COMPANY, KIND, VIOLATION, Driver, Drivers, Traffic, Vehicle
from dubins_traffic.policies.rules.turn_arcs import NO_DIRECTION, PART, ReferencePath, in_arc, on_lane, way_between
from dubins_traffic.policies.safety import VERGE
from dubins_traffic.roads.lookup import CERTAIN, lane_end
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.propositions import FLAG

IF_NOT_BEHIND_EGO = 2.0
"""Value of `KeptCommands.holds`: the cached command is valid if the ego is not ahead in the car's lane."""


@jit_inline
def check_command_caches(b: int, traffic: Traffic) -> None:
    """Find which cars of trial b are still in the stretch of their cached command, and compute their commands.

    The loop over cars has no branches, so that the compiler works on several cars at once.
    """
    state, drivers = traffic.state, traffic.drivers
    vehicle = drivers.vehicle[b]
    count = state.count[b]
    for first in range(0, count, BLOCK):
        here = min(count - first, BLOCK)
        block = drivers.command[b, first // BLOCK]
        _load_positions(b, first, here, state, block)
        _check_valid_stretches(block, (here + WIDE - 1) & -WIDE, vehicle.yaw_most, vehicle.period)


@jit_inline
def _load_positions(b: int, first: int, here: int, state: State, block: KeptCommands) -> None:
    """Copy the poses of the `here` cars from car `first` on into their block."""
    x, y, c, s = state.x[b], state.y[b], state.c[b], state.s[b]
    here_x, here_y, here_c, here_s = block.here_x, block.here_y, block.here_c, block.here_s
    if state.x.shape[1] % TOGETHER == 0:
        for k in range(0, here, TOGETHER):
            copy_together(c, first + k, here_c, k)
            copy_together(s, first + k, here_s, k)
            copy_together(x, first + k, here_x, k)
            copy_together(y, first + k, here_y, k)
        return
    for k in range(here):
        n = first + k
        here_x[k], here_y[k], here_c[k], here_s[k] = x[n], y[n], c[n], s[n]


@jit_inline
def _check_valid_stretches(block: KeptCommands, last: int, limit: float, period: float) -> None:
    """Find which of the first `last` cars of a block are in their valid stretch; compute the commands of all."""
    x, y, c, s = block.here_x, block.here_y, block.here_c, block.here_s
    low, high, past_most, minds, astray = block.low, block.high, block.past, block.minds, block.astray
    way_x, way_y, tx, ty, ux, uy = block.x, block.y, block.tx, block.ty, block.ux, block.uy
    cx, cy, radius, sides, middle = block.cx, block.cy, block.radius, block.side, block.middle
    bends, speeds, holds, now, yaw_rates = block.bend, block.speed, block.holds, block.now, block.yaw_rate
    for k in range(last):
        dx = x[k] - cx[k]
        dy = y[k] - cy[k]
        along = dx * tx[k] + dy * ty[k]
        past = dx * ux[k] + dy * uy[k]
        far = max(sqrt(dx * dx + dy * dy), NO_DIRECTION)
        bend, side = bends[k], sides[k]
        in_arc_left = side * (radius[k] - far)
        in_lane_left = tx[k] * (y[k] - way_y[k]) - ty[k] * (x[k] - way_x[k]) + middle[k]
        bent = bend != 0.0
        left = in_arc_left if bent else in_lane_left
        px = -side * (dy / far) if bent else tx[k]
        py = side * (dx / far) if bent else ty[k]
        inside = (low[k] < along) & (along < high[k]) & (past < past_most[k]) & (left <= astray[k])
        held = 1.0 if along <= minds[k] else IF_NOT_BEHIND_EGO
        holds[k] = held if inside else 0.0
        now[k], yaw_rates[k] = steer(c[k], s[k], left, px, py, bend, speeds[k], SLANT, ALIGNED, limit, 0.0, period)


@jit_look
def repeat_command(b: int, n: int, tick: int, kind: int, company: int, traffic: Traffic, commands: Floats) -> bool:
    """Write the cached command of a car if it is still valid; tell whether it is. Called after `check_command_caches`.

    Whether another car matters to it is looked up here unless `company` says that none does.
    """
    state, labels, drivers = traffic.state, traffic.labels, traffic.drivers
    block = drivers.command[b, n // BLOCK]
    k = n & (BLOCK - 1)
    holds = block.holds[k]
    if holds == 0.0:
        return False
    row = drivers.way[b, n]
    changed = labels.lane[b, n] != row.coast_lane or labels.crosses[b, n] != row.coast_crosses
    bits = np.int64(labels.bits[b, n])
    if changed or bits & (FLAG.STOPPED | FLAG.BLOCKED | FLAG.LEFT) != row.coast_stopped or bits & GOES_NOW == GOES_NOW:
        return False
    x, y = state.x[b, n], state.y[b, n]
    if kind == KIND.ROUND and not keeps_to_road(b, n, x, y, kept_way(row), traffic.roads, drivers):
        return False
    if holds == IF_NOT_BEHIND_EGO and is_behind_ego(b, n, x, y, kept_way(row), traffic):
        return False
    if row.coast_special != 0:
        if row.coast_waits != 0 and (x != row.coast_x or y != row.coast_y):
            return False
        if row.coast_chooses != 0 and not keeps_exit(b, n, tick, row, traffic):
            return False
    if company != COMPANY.ALONE and not still_meets_nobody(b, n, block.bend[k], x, y, kept_way(row), traffic):
        return False
    if row.coast_chooses != 0:
        drivers.car[b, n].within += 1
    commands[b, n, 0] = block.now[k]
    commands[b, n, 1] = block.yaw_rate[k]
    return True


@jit_inline
def still_meets_nobody(b: int, n: int, bend: float, x: float, y: float, way: ReferencePath, traffic: Traffic) -> bool:
    """Do as `meets_nobody`, for a car on its lane, or in its arc if its line has a `bend` (1/m)."""
    if bend == 0.0:
        part, key, left, _, _ = on_lane(way, x, y)
    else:
        part, key, left, _, _ = in_arc(way, x - way.cx, y - way.cy)
    return meets_nobody(b, n, part, key, left, x, y, way, traffic.state, traffic.drivers.vehicle[b])


@jit_inline
def forget_command(b: int, n: int, drivers: Drivers) -> None:
    """Make the cached command of a car invalid."""
    drivers.command[b, n // BLOCK].low[n & (BLOCK - 1)] = NOWHERE


@jit_inline
def drive_freely(
    b: int, n: int, part: int, left: float, px: float, py: float, outside: bool, chooses: bool, way: ReferencePath,
    traffic: Traffic, commands: Floats,
) -> bool:  # fmt: skip
    """Write and cache the command of a car if it has nothing to mind but its line; tell whether that is so.

    It is for cars of which `policy.just_drives` holds and around which nothing matters. Such a car may also wait at a
    line.
    """
    state, labels, roads, drivers = traffic.state, traffic.labels, traffic.roads, traffic.drivers
    vehicle = drivers.vehicle[b]
    car = drivers.car[b, n]
    row = drivers.way[b, n]
    x, y = state.x[b, n], state.y[b, n]
    bits = np.int64(labels.bits[b, n])
    if part == PART.AFTER or vehicle.tightest > 0.0 or has_more_to_mind(bits, car):
        return False
    if car.kind == KIND.ROUND and not keeps_to_road(b, n, x, y, way, roads, drivers):
        return False
    speed = cruise(False, labels.crosses[b, n] >= 0, vehicle, drivers.car[b, n])
    bend = way.bend if part == PART.THROUGH else 0.0
    gated = faces_gate(b, n, part, traffic)
    if labels.lane[b, n] < 0 and left > ASTRAY:
        return False
    if gated and car.kind != KIND.ROUND and is_behind_ego(b, n, x, y, way, traffic):
        return False
    line = to_line(left, x, y, way, vehicle) if gated else NOWHERE
    waits = line < speed * vehicle.period
    if waits:
        if row.crossing == 0 or bits & GOES_NOW == GOES_NOW or car.violations & VIOLATION.ROLLING != 0:
            return False
        speed = max(0.0, line) / vehicle.period
    row.coast_chooses = 1 if chooses else 0
    row.coast_waits = 1 if waits else 0
    row.coast_special = 1 if chooses or waits else 0
    row.coast_stopped = int(bits & FLAG.STOPPED) if waits else 0
    cache_command(b, n, speed, part, outside, gated, x, y, way, traffic)
    if gated:
        count_turn(bits, row, car)
    car.waited = 0
    car.within += 1 if chooses else 0
    follow_line(b, n, speed, left, px, py, bend, traffic, commands)
    return True


@jit_inline
def has_more_to_mind(bits: np.int64, car: Driver) -> bool:
    """Tell whether a car with the flags `bits` (FLAG) passes something, drives on the left, or stands by choice."""
    passes = bits & (FLAG.BLOCKED | FLAG.LEFT) != 0 or car.violations & VIOLATION.LEFT_SIDE != 0
    return passes or car.hold > 0.0 or car.pause > 0.0


@jit_inline
def cache_command(
    b: int, n: int, speed: float, part: int, outside: bool, gated: bool, x: float, y: float, way: ReferencePath,
    traffic: Traffic,
) -> None:  # fmt: skip
    """Cache the command of a car that has nothing around it, with the stretch of its way on which it is valid.

    The stretch ends before the line at which the car may have to stop; an e-agent stops earlier behind the ego. For a
    car without lane state it also ends where the arc does, since there the part of the way changes, or the lane. The
    command of a car that waits at its line is valid until the car has moved, or it is its turn.
    """
    labels, drivers = traffic.labels, traffic.drivers
    vehicle = drivers.vehicle[b]
    row = drivers.way[b, n]
    block = drivers.command[b, n // BLOCK]
    k = n & (BLOCK - 1)
    bend = way.bend if part == PART.THROUGH else 0.0
    high = NOWHERE if outside or part == PART.THROUGH else 0.0
    minds = NOWHERE
    if gated:
        along = (x - way.cx) * way.tx + (y - way.cy) * way.ty
        edge = vehicle.disc + vehicle.reach + vehicle.unsure + MARGIN
        spare = -way_to_go(way, x, y) - edge - speed * vehicle.period - CERTAIN
        high = min(high, along + spare)
        if drivers.car[b, n].kind != KIND.ROUND:
            minds = along + spare - vehicle.approaches
        if row.coast_waits != 0:
            high = NOWHERE
    block.low[k] = 0.0 if part == PART.THROUGH else -NOWHERE
    block.high[k] = high
    block.past[k] = NOWHERE if outside else 0.0
    block.minds[k] = minds
    block.astray[k] = ASTRAY if labels.lane[b, n] < 0 else NOWHERE
    block.speed[k] = slowed(speed, bend, vehicle.yaw_most)
    block.bend[k] = bend
    block.x[k], block.y[k] = way.x, way.y
    block.tx[k], block.ty[k], block.ux[k], block.uy[k] = way.tx, way.ty, way.ux, way.uy
    block.cx[k], block.cy[k], block.radius[k], block.side[k] = way.cx, way.cy, way.radius, way.side
    block.middle[k] = way.middle
    row.coast_x, row.coast_y = x, y
    row.coast_lane = labels.lane[b, n]
    row.coast_crosses = labels.crosses[b, n]


@jit_inline
def cruise(hurries: bool, in_disc: bool, vehicle: Vehicle, car: Driver) -> float:
    """Return the speed at which a car drives if nothing is in its way."""
    speed = vehicle.fastest if hurries else car.speed
    if in_disc:
        speed = min(max(speed, vehicle.through_speed), vehicle.fastest)
    return speed


@jit_inline
def keeps_to_road(b: int, n: int, x: float, y: float, way: ReferencePath, roads: RoadTable, drivers: Drivers) -> bool:
    """Tell whether a car is certain to keep VERGE from the edge of the road for a tick, whatever it does.

    It is so near to the lane it is on, to the next one, or to the intersection between, that it can't get so far from
    it in a tick.
    """
    vehicle = drivers.vehicle[b]
    row = drivers.way[b, n]
    travel = vehicle.fastest * vehicle.period
    room = max(float(roads.half_width[drivers.net[b]]) - VERGE - travel - CERTAIN, 0.0)
    rx, ry = x - way.x, y - way.y
    to_go = -(rx * way.tx + ry * way.ty)
    since = rx * way.ux + ry * way.uy
    before = 0.0 < to_go < row.length and abs(way.tx * ry - way.ty * rx) < room
    behind = 0.0 < since < row.out_length and abs(way.ux * ry - way.uy * rx) < room
    return before or behind or rx * rx + ry * ry < room * room


@jit_inline
def way_of(b: int, n: int, roads: RoadTable, drivers: Drivers) -> ReferencePath:
    """Return the way of car n from its lane to the next one, from the cache if that is valid."""
    car = drivers.car[b, n]
    row = drivers.way[b, n]
    if not _is_of(car.lane, car.next_lane, row):
        keep_way(b, n, roads, drivers)
    return kept_way(row)


@jit_look
def _is_of(lane: int, out: int, row: KeptPath) -> bool:
    """Tell whether the cached way leads from `lane` to lane `out`."""
    return row.lane == lane and row.out == out


@jit_inline
def kept_way(row: KeptPath) -> ReferencePath:
    """Return the way that a row of `Drivers.way` holds."""
    return ReferencePath(
        row.x, row.y, row.tx, row.ty, row.ux, row.uy, row.cx, row.cy, row.radius, row.side, row.middle, row.bend
    )  # fmt: skip


@jit
def keep_way(b: int, n: int, roads: RoadTable, drivers: Drivers) -> None:
    """Compute the way of car n from its lane to the next one and store it in the cache."""
    net = drivers.net[b]
    vehicle = drivers.vehicle[b]
    car = drivers.car[b, n]
    row = drivers.way[b, n]
    way = way_between(roads, net, car.lane, car.next_lane, vehicle.middle, vehicle.disc)
    row.lane = car.lane
    row.out = car.next_lane
    degree = roads.degree[roads.vert_off[net] + lane_end(roads, net, car.lane)]
    row.crossing = 1 if degree >= vehicle.degree else 0
    row.length = roads.segment[int(roads.seg_off[net]) + (car.lane >> 1)].length
    row.out_length = roads.segment[int(roads.seg_off[net]) + (car.next_lane >> 1)].length
    mouth, _ = queue_lengths(vehicle)
    row.roomy = 1 if row.out_length - mouth - mouth >= 0.0 else 0
    row.x, row.y = way.x, way.y
    row.tx, row.ty = way.tx, way.ty
    row.ux, row.uy = way.ux, way.uy
    row.cx, row.cy = way.cx, way.cy
    row.radius, row.side = way.radius, way.side
    row.middle, row.bend = way.middle, way.bend
