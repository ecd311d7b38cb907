"""Cars that just drive on: what they do is kept, with the stretch of their way on which it is certain to stay so
(compiled).

Most cars have nothing around them and follow a lane or an arc. Of these only the offset from their line, and its
direction, change from tick to tick.
"""

from __future__ import annotations

import numpy as np

from dubins_traffic.kernels.compile import jit_inline
from dubins_traffic.policies.rules.choice import keeps_exit
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
    LEFT_SIDE,
    ROLLING,
    ROUND,
    Driver,
    Drivers,
    KeptPath,
    Traffic,
    Vehicle,
)
from dubins_traffic.policies.rules.turn_arcs import AFTER, THROUGH, ReferencePath, in_arc, on_lane
from dubins_traffic.policies.safety import VERGE
from dubins_traffic.roads.lookup import CERTAIN
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.propositions import BLOCKED, LEFT, STOPPED

EVERYWHERE = 1e9
"""Metres that no way is long."""


@jit_inline
def coast(b: int, n: int, tick: int, kind: int, company: int, traffic: Traffic) -> bool:
    """Put off the command of a car that still just drives on as it did; tell whether it does.

    Nothing is around the car that matters to it, as far as `company` says so; else that is found here.
    """
    state, labels, roads, drivers = traffic.state, traffic.labels, traffic.roads, traffic.drivers
    row = drivers.way[b, n]
    x, y = state.x[b, n], state.y[b, n]
    way = kept_way(row)
    dx, dy = x - way.cx, y - way.cy
    along = dx * way.tx + dy * way.ty
    past = dx * way.ux + dy * way.uy
    if not (row.coast_low < along < row.coast_high and past < row.coast_past):
        return False
    changed = labels.lane[b, n] != row.coast_lane or labels.crosses[b, n] != row.coast_crosses
    if changed or np.int64(labels.bits[b, n]) & (STOPPED | BLOCKED | LEFT) != 0:
        return False
    if kind == ROUND and not keeps_to_road(b, n, x, y, way, roads, drivers):
        return False
    bend = row.coast_bend
    if bend == 0.0:
        part, key, left, px, py = on_lane(way, x, y)
    else:
        part, key, left, px, py = in_arc(way, dx, dy)
    if row.coast_lane < 0 and left > ASTRAY:
        return False
    if along > row.coast_minds and is_behind_ego(b, n, x, y, way, traffic):
        return False
    if row.coast_chooses != 0 and not keeps_exit(b, n, tick, row, traffic):
        return False
    if company != ALONE and not meets_nobody(b, n, part, key, left, x, y, way, state, drivers.vehicle[b]):
        return False
    if row.coast_chooses != 0:
        drivers.car[b, n].within += 1
    note(b, n, row.coast_speed, left, px, py, bend, traffic)
    return True


@jit_inline
def stop_coasting(row: KeptPath) -> None:
    """Forget what a car did; `row` is its row of `Drivers.way`."""
    row.coast_low = EVERYWHERE


@jit_inline
def drive_on(
    b: int,
    n: int,
    part: int,
    left: float,
    px: float,
    py: float,
    outside: bool,
    chooses: bool,
    way: ReferencePath,
    traffic: Traffic,
) -> bool:
    """Put off the command of a car that just drives on, or waits at a line; tell whether it does, else do nothing.

    Nothing is around the car that matters to it (`policy.just_drives`). What it does is kept for the ticks to come.
    """
    state, labels, roads, drivers = traffic.state, traffic.labels, traffic.roads, traffic.drivers
    vehicle = drivers.vehicle[b]
    car = drivers.car[b, n]
    row = drivers.way[b, n]
    x, y = state.x[b, n], state.y[b, n]
    bits = np.int64(labels.bits[b, n])
    special = bits & (BLOCKED | LEFT) != 0 or car.violations & LEFT_SIDE != 0
    if special or drivers.car[b, n].hold > 0.0 or vehicle.tightest > 0.0 or part == AFTER:
        return False
    if car.kind == ROUND and not keeps_to_road(b, n, x, y, way, roads, drivers):
        return False
    speed = cruise(False, labels.crosses[b, n] >= 0, vehicle, drivers.car[b, n])
    bend = way.bend if part == THROUGH else 0.0
    gated = faces_gate(b, n, part, traffic)
    if labels.lane[b, n] < 0 and left > ASTRAY:
        return False
    if gated and car.kind != ROUND and is_behind_ego(b, n, x, y, way, traffic):
        return False
    line = to_line(left, x, y, way, vehicle) if gated else EVERYWHERE
    if line < speed * vehicle.period:
        if row.crossing == 0 or bits & GOES_NOW == GOES_NOW or car.violations & ROLLING != 0:
            return False
        speed = max(0.0, line) / vehicle.period
    else:
        keep_course(b, n, speed, part, outside, gated, x, y, way, traffic)
        row.coast_chooses = 1 if chooses else 0
    if gated:
        count_turn(bits, row, car)
    car.waited = 0
    car.within += 1 if chooses else 0
    note(b, n, slowed(speed, bend, vehicle.yaw_most), left, px, py, bend, traffic)
    return True


@jit_inline
def keep_course(
    b: int,
    n: int,
    speed: float,
    part: int,
    outside: bool,
    gated: bool,
    x: float,
    y: float,
    way: ReferencePath,
    traffic: Traffic,
) -> None:
    """Keep what a car does that has nothing around it, and on which stretch of its way it is certain to do the same.

    The stretch ends before the line at which the car may have to stop; an e-agent stops earlier behind the ego. Without
    lane state it also ends where the arc does: there the part of the way changes, or the lane.
    """
    labels, drivers = traffic.labels, traffic.drivers
    vehicle = drivers.vehicle[b]
    row = drivers.way[b, n]
    bend = way.bend if part == THROUGH else 0.0
    row.coast_low = 0.0 if part == THROUGH else -EVERYWHERE
    row.coast_high = EVERYWHERE if outside or part == THROUGH else 0.0
    row.coast_past = EVERYWHERE if outside else 0.0
    row.coast_minds = EVERYWHERE
    if gated:
        along = (x - way.cx) * way.tx + (y - way.cy) * way.ty
        edge = vehicle.disc + vehicle.reach + MARGIN
        spare = -way_to_go(way, x, y) - edge - speed * vehicle.period - CERTAIN
        row.coast_high = min(row.coast_high, along + spare)
        if drivers.car[b, n].kind != ROUND:
            row.coast_minds = along + spare - vehicle.approaches
    row.coast_speed = slowed(speed, bend, vehicle.yaw_most)
    row.coast_bend = bend
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
def keeps_to_road(
    b: int, n: int, x: float, y: float, way: ReferencePath, roads: RoadTable, drivers: Drivers
) -> bool:
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
