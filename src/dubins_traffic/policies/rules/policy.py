"""The law of the road, compiled: one tick of all cars that keep the rules, e-agents and the ego alike.

A car drives its way (`policies.rules.turn_arcs`) in the right lane, stops before every disc that it may not enter,
keeps behind what is ahead, and passes what stands (`policies.rules.passing`). It enters a crossing only on its turn,
as its propositions tell, and any disc only if there is room behind it: so no disc is ever blocked by a queue. A last
look before every tick rules out all motions that could bring about a contact, whatever the others do.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dubins_traffic.cars.near import FEW
from dubins_traffic.cars.state import EGO, Labels, Pose
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.compile import jit, jit_inline, jit_rare
from dubins_traffic.policies.rules.choice import STUCK, find_way_out, keeps_exit
from dubins_traffic.policies.rules.chosen import keeps_own_gap, pauses
from dubins_traffic.policies.rules.command_cache import (
    check_command_caches,
    cruise,
    drive_freely,
    forget_command,
    repeat_command,
    way_of,
)
from dubins_traffic.policies.rules.exits import count_visit, take_lane, ticks_of, watch_ego
from dubins_traffic.policies.rules.leaning import lean
from dubins_traffic.policies.rules.narrow import EDGE, within_lane
from dubins_traffic.policies.rules.passing import PASSING_WAIT, find_way_past, keep_off
from dubins_traffic.policies.rules.returning import keep_passing
from dubins_traffic.policies.rules.right_of_way import before_ego, kept_out_for_long, yield_at_line
from dubins_traffic.policies.rules.room import is_pressed
from dubins_traffic.policies.rules.seeing import (
    LISTED,
    QUEUE_GAP,
    alone,
    enlist,
    gather,
    look_ahead,
    meets_nobody,
    unlist_cars,
    wanted_gap,
    way_to_go,
)
from dubins_traffic.policies.rules.standing import watch
from dubins_traffic.policies.rules.steering import follow_line, follows_line, move
from dubins_traffic.policies.rules.straying import strays
from dubins_traffic.policies.rules.tables import COMPANY, KIND, VIOLATION, Driver, Drivers, Traffic, Vehicle
from dubins_traffic.policies.rules.turn_arcs import PART, ReferencePath, on_lane, on_way
from dubins_traffic.policies.rules.unrolled import bends_ahead, roll_up, unroll
from dubins_traffic.roads.lookup import INFINITE, lane_end
from dubins_traffic.routing.lane_graph import lane_at
from dubins_traffic.rules.propositions import FLAG

BUMPER = 0.005
"""Gap that a tailgating car, which trusts the one ahead not to brake, keeps behind it while it moves, metres."""


@jit
def decide(tick: int, commands: Floats, traffic: Traffic) -> None:
    """Write the commands of all cars that the law drives."""
    drivers, scratch = traffic.drivers, traffic.scratch
    for b in range(drivers.active.shape[0]):
        if drivers.active[b] != 0:
            decide_trial(b, tick, -1.0, scratch.apart, 0.0, traffic, commands)


@jit_inline
def decide_trial(
    b: int, tick: int, sight2: float, apart: Floats, loss: float, traffic: Traffic, commands: Floats
) -> None:
    """Write the commands of the cars of one trial that the law drives.

    The ego takes into account the cars whose squared distance from it is at most `sight2` (m2), all if that is
    negative. `apart` (N,) less `loss` (m) is a lower bound on the distance from each car to the nearest other.
    """
    state, labels, obstacles, drivers, scratch = (
        traffic.state, traffic.labels, traffic.obstacles, traffic.drivers, traffic.scratch,
    )  # fmt: skip
    scratch.listed[0] = LISTED.NOBODY
    enough = loss + alone(drivers.vehicle[b])
    others = COMPANY.UNSURE if state.count[b] <= FEW else COMPANY.CROWDED
    if obstacles.off[b] != obstacles.off[b + 1]:
        enough = INFINITE
        others = COMPANY.CROWDED
    bends = traffic.roads.piece.shape[0] > 0
    check_command_caches(b, traffic)
    for n in range(state.count[b]):
        company = others if apart[n] > 0.0 else COMPANY.CROWDED
        if apart[n] > enough:
            company = COMPANY.ALONE
        kind = drivers.car[b, n].kind
        if kind == KIND.ROUND:
            count_visit(b, n, labels, drivers)
        if kind == KIND.ABSENT:
            continue
        if parks(b, n, tick, labels, drivers):
            commands[b, n, 0] = 0.0
            commands[b, n, 1] = 0.0
            continue
        unrolled = bends and unroll_curve(b, n, tick, sight2, traffic)
        if unrolled:
            company = COMPANY.UNROLLED
        if company >= COMPANY.CROWDED or not repeat_command(b, n, tick, kind, company, traffic, commands):
            drive(b, n, tick, company, sight2, traffic, commands)
        if unrolled:
            roll_up(b, n, traffic, commands)
    if scratch.listed[0] != LISTED.NOBODY:
        unlist_cars(b, traffic)


@jit_rare
def unroll_curve(b: int, n: int, tick: int, sight2: float, traffic: Traffic) -> bool:
    """Unroll the road of a car if it bends between it and the end of its lane; tell whether it does.

    A car in a disc may have come to the lane out in this tick; then that lane counts. `sight2` (m^2) is the square of
    how far the ego sees. This is not part of `drive`, which is faster on straight roads without it.
    """
    state = traffic.state
    if traffic.labels.lane[b, n] < 0:
        keep_place(b, n, tick, state.x[b, n], state.y[b, n], state.c[b, n], state.s[b, n], traffic)
    if not bends_ahead(b, n, traffic):
        return False
    enlist(b, n, sight2, traffic)
    unroll(b, n, traffic)
    return True


@jit_inline
def parks(b: int, n: int, tick: int, labels: Labels, drivers: Drivers) -> bool:
    """Tell whether a car still stands where it started: it may, unless it would keep others from a crossing."""
    if tick * drivers.vehicle[b].period >= drivers.car[b, n].departs:
        return False
    bits = np.int64(labels.bits[b, n])
    return labels.crosses[b, n] < 0 and labels.lane[b, n] >= 0 and bits & (FLAG.APPROACH | FLAG.STOPPED) == 0


@jit_inline
def drive(b: int, n: int, tick: int, company: int, sight2: float, traffic: Traffic, commands: Floats) -> None:
    """Write the command of a car; `company` says what is known of the cars around it."""
    state, labels, roads, drivers = traffic.state, traffic.labels, traffic.roads, traffic.drivers
    vehicle = drivers.vehicle[b]
    car = drivers.car[b, n]
    x, y = state.x[b, n], state.y[b, n]
    forget_command(b, n, drivers)
    if car.kind == KIND.NEMESIS:
        watch_ego(b, n, labels, drivers)
    way = keep_place(b, n, tick, x, y, state.c[b, n], state.s[b, n], traffic)
    part, key, left, px, py = on_way(way, x, y)
    outside = labels.lane[b, n] == car.lane
    if outside and part != PART.BEFORE:
        part, key, left, px, py = on_lane(way, x, y)
    leaves = car.kind != KIND.ROUND and labels.crosses[b, n] == lane_end(roads, drivers.net[b], car.lane)
    chooses = leaves and drivers.way[b, n].crossing != 0
    # It has leaned to the outside of a bend, and must not leave the road there.
    beyond = left < EDGE - vehicle.middle and vehicle.tightest == 0.0
    free = company < COMPANY.CROWDED and just_drives(car) and not beyond
    free = free and (not chooses or keeps_exit(b, n, tick, drivers.way[b, n], traffic))
    if free and company != COMPANY.ALONE:
        free = meets_nobody(b, n, part, key, left, x, y, way, state, vehicle)
    if free and drive_freely(b, n, part, left, px, py, outside, chooses, way, traffic, commands):
        return
    enlist(b, n, sight2, traffic)
    near = 0
    if not (free and not chooses and drivers.way[b, n].crossing != 0):
        near = gather(b, n, car.lane, x, y, way, traffic)
    gap, who, close = look_ahead(b, n, part, key, left, x, y, way, near, traffic)
    rides = car.violations & VIOLATION.TAILGATING != 0 and outside and who >= 0 and labels.lane[b, who] == car.lane
    speed = cruise(rides or car.aside != 0.0, labels.crosses[b, n] >= 0, vehicle, car)
    speed = yield_at_line(b, n, tick, speed, part, left, x, y, way, near, traffic)
    kept = 0.0
    if who != -1:
        speed, kept = follow(b, n, speed, gap, who, rides, part, way, traffic)
    speed = dawdle(b, n, speed, -way_to_go(way, x, y), near, traffic)
    speed, offset = pass_what_stands(b, n, speed, gap, kept, who, part, outside, way, near, traffic)
    offset += lean(b, n, offset, part, way, near, traffic)
    if leaves:
        find_way_out(b, n, tick, part, traffic)
    bend = way.bend if part == PART.THROUGH else 0.0
    if not (close or beyond) and follows_line(b, n, left - offset, traffic):
        follow_line(b, n, speed, left - offset, px, py, bend, traffic, commands)
        return
    listed, trusted = near if close else 0, who if rides else -1
    speed, yaw_rate = move(
        b, n, speed, left, offset, px, py, bend, outside, way, listed, trusted, traffic
    )  # fmt: skip
    checked = (car.kind == KIND.ROUND or offset < 0.0 or speed < 0.0 or beyond) and company != COMPANY.UNROLLED
    if speed != 0.0 and checked and strays(b, n, speed, yaw_rate, way, traffic):
        speed = 0.0
    commands[b, n, 0] = speed
    commands[b, n, 1] = yaw_rate


@jit_inline
def just_drives(car: Driver) -> bool:
    """Tell whether a car has no reason to look at far cars, unless it enters a bend or dead end."""
    return car.kind != KIND.NEMESIS and car.violations & VIOLATION.TAILGATING == 0 and car.aside == 0.0


@jit_inline
def follow(
    b: int, n: int, speed: float, gap: float, who: int, rides: bool, part: int, way: ReferencePath,
    traffic: Traffic,
) -> tuple[float, float]:  # fmt: skip
    """Return (speed, gap to keep) of a car that has `who` ahead."""
    state, labels, drivers = traffic.state, traffic.labels, traffic.drivers
    vehicle = drivers.vehicle[b]
    car = drivers.car[b, n]
    kept = BUMPER if rides else wanted_gap(b, n, who, way, traffic, car, part, vehicle.reach)
    if car.keeps > 0.0 and who >= 0 and keeps_own_gap(b, n, who, labels, car):
        kept = car.keeps
    if kept > QUEUE_GAP and not rides and who != -1:
        turn = part == PART.BEFORE and (car.turn > 0 or kept_out_for_long(car, vehicle))
        if turn or is_pressed(b, n, traffic):
            kept = QUEUE_GAP
    ahead = max(0.0, state.speed[b, who]) if rides else 0.0
    return min(speed, max(0.0, gap - kept) / vehicle.period + ahead), kept


@jit_inline
def dawdle(b: int, n: int, speed: float, to_go: float, near: int, traffic: Traffic) -> float:
    """Return the speed of a car that may hold up the ego, or stand in its lane or in a disc, on purpose.

    It is `to_go` metres before the end of its lane.
    """
    labels, roads, drivers = traffic.labels, traffic.roads, traffic.drivers
    car = drivers.car[b, n]
    passes = car.aside != 0.0
    if car.kind == KIND.NEMESIS and not passes and before_ego(b, n, near, traffic):
        speed = min(speed, traffic.drivers.vehicle[b].dawdle)
    if car.pause > 0.0 and pauses(b, n, to_go, labels, traffic):
        speed = 0.0
    if car.hold > 0.0 and labels.at[b, n] == lane_end(roads, drivers.net[b], car.lane):
        car.hold -= drivers.vehicle[b].period
        speed = 0.0
    return speed


@jit_inline
def pass_what_stands(
    b: int, n: int, speed: float, gap: float, kept: float, who: int, part: int, outside: bool,
    way: ReferencePath, near: int, traffic: Traffic,
) -> tuple[float, float]:  # fmt: skip
    """Return (speed, offset to the left of the way): of a car that drives on the left, or passes, or waits to."""
    state, labels, drivers = traffic.state, traffic.labels, traffic.drivers
    vehicle = drivers.vehicle[b]
    car = drivers.car[b, n]
    bits = np.int64(labels.bits[b, n])
    if outside and (bits & FLAG.BLOCKED != 0 or car.aside != 0.0):
        watch(b, n, who, traffic)
    offset = 2.0 * vehicle.middle if car.violations & VIOLATION.LEFT_SIDE != 0 and outside else 0.0
    # An ego that stands at the edge of the lane may leave room to pass it there, and does not excuse who waits (E5).
    narrows = bits & FLAG.BLOCKED != 0 or (who == EGO and labels.bits[b, EGO] & FLAG.STANDS != 0)
    stubborn = part == PART.THROUGH or who < 0 or narrows or offset != 0.0
    car.waited = car.waited + 1 if stubborn and gap < kept + 0.05 else 0
    if offset != 0.0 and car.waited > ticks_of(STUCK, vehicle):
        car.violations &= ~VIOLATION.LEFT_SIDE
    stuck = car.aside != 0.0 and within_lane(car.aside, vehicle) and car.waited > ticks_of(STUCK, vehicle)
    if stuck and outside and car.waited % 4 == 0:
        find_way_past(b, n, way, who, traffic)
        stuck = car.waited > 0
    if who < -1 and part == PART.BEFORE and (stuck or car.aside == 0.0) and offset == 0.0:
        keep_off(b, n, -2 - who, way, traffic)
    if not outside:
        there = part == PART.BEFORE and within_lane(car.aside, vehicle)
        car.aside = offset = car.aside if there else 0.0
    elif car.aside != 0.0:
        speed = keep_passing(b, n, speed, way, near, traffic)
        offset = car.aside if way_to_go(way, state.x[b, n], state.y[b, n]) < car.until else 0.0
    elif (narrows or who < -1) and waited_long(car, bits, vehicle):
        find_way_past(b, n, way, who, traffic)
    return speed, offset


@jit_inline
def waited_long(car: Driver, bits: Any, vehicle: Vehicle) -> bool:
    """Tell whether it is time to look for a way past: not in every tick, and sooner for a car that is left already."""
    return (car.waited >= ticks_of(PASSING_WAIT, vehicle) or bits & FLAG.LEFT != 0) and car.waited % 4 == 0


@jit_inline
def keep_place(b: int, n: int, tick: int, x: float, y: float, c: float, s: float, traffic: Traffic) -> ReferencePath:
    """Update `Driver.lane` and `Driver.next_lane` to where the car is; return its way."""
    labels, roads, drivers = traffic.labels, traffic.roads, traffic.drivers
    net = drivers.net[b]
    vehicle = drivers.vehicle[b]
    car = drivers.car[b, n]
    seen = labels.lane[b, n]
    if car.lane < 0:
        lane = seen if seen >= 0 else lane_at(roads, net, Pose(x, y, c, s))
        take_lane(b, n, tick, lane, traffic)
    elif seen >= 0 and seen != car.lane:
        take_lane(b, n, tick, seen, traffic)
    way = way_of(b, n, roads, drivers)
    if seen < 0 and (x - way.x) * way.tx + (y - way.y) * way.ty > -1.5 * vehicle.disc:
        part, _, _, _, _ = on_way(way, x, y)
        if part == PART.AFTER:
            take_lane(b, n, tick, car.next_lane, traffic)
            way = way_of(b, n, roads, drivers)
    return way
