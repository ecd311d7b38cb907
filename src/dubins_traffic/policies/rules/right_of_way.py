"""Decides whether a car may enter the disc ahead: its turn at a crossing, and room behind the disc (compiled)."""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from dubins_traffic.cars.state import EGO, State
from dubins_traffic.kernels.compile import jit, jit_inline, jit_rare
from dubins_traffic.policies.rules.abilities import PATIENT
from dubins_traffic.policies.rules.choice import (
    is_about_to_enter,
    is_way_on_free,
    take_another,
    take_last_resort,
    take_way_on,
    take_widest,
)
from dubins_traffic.policies.rules.chosen import holds
from dubins_traffic.policies.rules.exits import ticks_of
from dubins_traffic.policies.rules.kept import KeptPath
from dubins_traffic.policies.rules.room import MARGIN, has_room, is_free
from dubins_traffic.policies.rules.seeing import SIDE, way_to_go
from dubins_traffic.policies.rules.tables import KIND, VIOLATION, Driver, Drivers, Traffic, Vehicle
from dubins_traffic.policies.rules.turn_arcs import PART, ReferencePath, on_way
from dubins_traffic.roads.lookup import INFINITE, lane_end, lane_start
from dubins_traffic.rules.propositions import FLAG

CHOOSY = 1.0
"""Seconds for which a car whose turn it is waits for room in its preferred exit."""
BUDGET = 4.0
"""Metres of detour that a car on its round accepts per second it has waited for room."""
DUTY = 0.8
"""An e-agent that has lost its place once enters after this share of the time in which it would lose it again, even
without room in any exit: otherwise it breaks E3."""
HUSH = 0.2
"""For this share of every half of the time in which each goal has to be free once (E6) e-agents enter a bend that is
a goal one after another."""
LINGER = 0.8
"""For this share of the time in which it would lose its place a nemesis makes the ego wait before it enters."""
TRAIL = 3.5
"""Distance within which a nemesis reacts to the ego, metres."""
GOES_NOW = FLAG.STOPPED | FLAG.FIRST | FLAG.CLEAR


@jit_inline
def yield_at_line(
    b: int, n: int, tick: int, speed: float, part: int, left: float, x: float, y: float, way: ReferencePath,
    near: int, traffic: Traffic,
) -> float:  # fmt: skip
    """Return the speed at which the car does not enter the disc at the end of its lane unless it may."""
    labels, roads, drivers = traffic.labels, traffic.roads, traffic.drivers
    net = drivers.net[b]
    vehicle = drivers.vehicle[b]
    car = drivers.car[b, n]
    if not faces_gate(b, n, part, traffic):
        return speed
    bits = np.int64(labels.bits[b, n])
    its_turn = count_turn(bits, drivers.way[b, n], car)
    line = to_line(left, x, y, way, vehicle)
    minds = n != EGO and car.violations & VIOLATION.TAILGATING == 0
    behind = minds and is_behind_ego(b, n, x, y, way, traffic)
    if behind and drivers.way[b, n].crossing != 0:
        line -= vehicle.approaches
        its_turn = False
    if line >= speed * vehicle.period:
        return speed
    v = lane_end(roads, net, car.lane)
    if drivers.way[b, n].crossing != 0:
        free = its_turn and may_go(b, n, tick, traffic)
        free = free or car.violations & VIOLATION.ROLLING != 0
    else:
        free = may_enter_bend(b, n, tick, v, way, near, traffic)
    if bits & FLAG.LEFT != 0 and car.violations & VIOLATION.LEFT_SIDE == 0:
        free = False
    return speed if free else max(0.0, line) / vehicle.period


@jit_rare
def may_enter_bend(b: int, n: int, tick: int, v: int, way: ReferencePath, near: int, traffic: Traffic) -> bool:
    """Tell whether a car may enter a bend or dead end: there is room behind it, and nobody in it is in its way.

    An e-agent enters none that the ego's body meets (E4). Who turns round in one does it alone, unless he stands there;
    who has waited for that for long takes the way on.
    """
    state, labels, roads, drivers, scratch = (
        traffic.state, traffic.labels, traffic.roads, traffic.drivers, traffic.scratch,
    )  # fmt: skip
    vehicle = drivers.vehicle[b]
    car = drivers.car[b, n]
    degree = roads.degree[roads.vert_off[drivers.net[b]] + v]
    turns = turns_round(car)
    hushed = is_hushed(tick, v, car, vehicle, drivers)
    inside = 0
    held = False
    long = kept_out_for_long(car, vehicle)
    for k in range(near):
        j = scratch.near[k]
        if labels.crosses[b, j] == v:
            inside += 1 if turns else shares_way(b, j, way, degree, state, vehicle)
            comes = turns_round(drivers.car[b, j]) and not (long and labels.bits[b, j] & FLAG.STANDS != 0)
            held = held or hushed or (n != EGO and (j == EGO or comes))
        elif turns and degree > 1:
            held = held or comes_first(b, n, j, v, traffic)
    if held or (inside > 0 and (turns or degree != 2)):
        free = False
    else:
        free = has_room(b, n, car.next_lane, inside, traffic)
        if long and inside == 0:
            free = free or is_free(b, n, car.next_lane, traffic) or moves_up(b, n, v, degree, traffic)
    if long and not free and turns and degree == 2:
        take_way_on(b, n, False, traffic)
    car.kept_out = 0 if free and not long else car.kept_out + 1
    return free


@jit_inline
def kept_out_for_long(car: Driver, vehicle: Vehicle) -> bool:
    """Tell whether an e-agent has stood before a bend or dead end for so long that E5 may ask it to come on."""
    return car.kind != KIND.ROUND and car.kept_out * vehicle.period > PATIENT * vehicle.rest_time


@jit_rare
def moves_up(b: int, n: int, v: int, degree: Any, traffic: Traffic) -> bool:
    """Tell whether a car that has waited for long before v goes in though its exit is not free: v is no goal (E5).

    Who would turn round in a bend, where the way back is no exit, takes the way on, if obstacles leave it one. If they
    leave none, it does not go in while the way on counts as free, since it would then owe E4.
    """
    car = traffic.drivers.car[b, n]
    if degree > 2 or minds_goal(v, car, traffic.drivers):
        return False
    return degree < 2 or not turns_round(car) or take_way_on(b, n, True, traffic) or not is_way_on_free(b, n, traffic)


@jit_inline
def minds_goal(v: int, car: Driver, drivers: Drivers) -> bool:
    """Tell whether the intersection v is a goal that the car is to leave free again and again (E6)."""
    minds = False
    for k in range(car.goal_first, car.goal_last):
        minds = minds or drivers.stage[k] == v
    return minds


@jit_inline
def is_hushed(tick: int, v: int, car: Driver, vehicle: Vehicle, drivers: Drivers) -> bool:
    """Tell whether a car that minds goals may now enter the bend v only if no car is in it.

    Without such times an endless row of cars through a bend would never leave it free.
    """
    half = ticks_of(0.5 * vehicle.goal_time, vehicle)
    if half <= 0 or tick % half < (1.0 - HUSH) * half:
        return False
    return minds_goal(v, car, drivers)


@jit_inline
def faces_gate(b: int, n: int, part: int, traffic: Traffic) -> bool:
    """Tell whether a car is before the disc at the end of its lane."""
    labels, roads, drivers = traffic.labels, traffic.roads, traffic.drivers
    return part == PART.BEFORE and labels.crosses[b, n] != lane_end(roads, drivers.net[b], drivers.car[b, n].lane)


@jit_inline
def count_turn(bits: Any, way: KeptPath, car: Driver) -> bool:
    """Tell whether it is the turn of a car before a disc, and count for how long; `way` is its row of `Drivers.way`."""
    its_turn = way.crossing != 0 and bits & GOES_NOW == GOES_NOW
    car.turn = car.turn + 1 if its_turn else 0
    car.owed = 0 if bits & FLAG.STOPPED == 0 else car.owed + (1 if its_turn else 0)
    return its_turn


@jit_inline
def to_line(left: float, x: float, y: float, way: ReferencePath, vehicle: Vehicle) -> float:
    """Return the distance, metres, to the line at which the car waits until it may enter the disc ahead."""
    edge = vehicle.disc + vehicle.reach + vehicle.unsure + MARGIN
    aside = left - vehicle.middle
    return -way_to_go(way, x, y) - sqrt(max(edge * edge - aside * aside, 0.0))


@jit_inline
def shares_way(b: int, j: int, way: ReferencePath, degree: Any, state: State, vehicle: Vehicle) -> int:
    """Return 1 if a car in the disc is on this way, or in a disc that is no bend."""
    if degree != 2:
        return 1
    _, _, left, _, _ = on_way(way, state.x[b, j], state.y[b, j])
    return 1 if abs(left) < 2.0 * (vehicle.half_width + vehicle.rounding) + SIDE else 0


@jit_inline
def is_behind_ego(b: int, n: int, x: float, y: float, way: ReferencePath, traffic: Traffic) -> bool:
    """Tell whether the ego is ahead in a car's lane.

    Such a car takes no place in the order of the crossing while the front of the ego is in the disc: the ego may back
    out again, and then bars the way of the car that is first.
    """
    state, labels, drivers = traffic.state, traffic.labels, traffic.drivers
    if labels.lane[b, EGO] != drivers.car[b, n].lane:
        return False
    return way_to_go(way, state.x[b, EGO], state.y[b, EGO]) > way_to_go(way, x, y)


@jit_inline
def turns_round(car: Driver) -> bool:
    """Tell whether a car that the law drives is about to turn round at the end of its lane, or does it."""
    return car.next_lane >= 0 and car.next_lane == car.lane ^ 1


@jit_inline
def comes_first(b: int, n: int, j: int, v: int, traffic: Traffic) -> bool:
    """Tell whether car j comes into a bend or dead end by another lane before car n, which turns round there."""
    drivers = traffic.drivers
    if traffic.labels.lane[b, j] == drivers.car[b, n].lane or not is_about_to_enter(b, j, v, traffic):
        return False
    return n == EGO or j < n or not turns_round(drivers.car[b, j])


@jit
def may_go(b: int, n: int, tick: int, traffic: Traffic) -> bool:
    """Tell whether a car whose turn it is may enter: there is room behind the crossing. It may choose another exit."""
    state, labels, drivers = traffic.state, traffic.labels, traffic.drivers
    car = drivers.car[b, n]
    vehicle = drivers.vehicle[b]
    bits = np.int64(labels.bits[b, n])
    due = car.kind != KIND.ROUND and is_due(car.turn, bits, vehicle)
    if (
        car.kind == KIND.NEMESIS
        and bits & FLAG.FORFEITED == 0
        and car.turn < ticks_of(LINGER * vehicle.forfeit, vehicle)
    ):
        dx = state.x[b, 0] - state.x[b, n]
        dy = state.y[b, 0] - state.y[b, n]
        if dx * dx + dy * dy < TRAIL * TRAIL:
            return False
    if not due and car.line_hold > 0.0 and holds(car, vehicle):
        return False
    if has_room(b, n, car.next_lane, 0, traffic):
        return True
    waited = car.owed - ticks_of(CHOOSY, vehicle)
    if not due and (waited < 0 or waited % 8 != 0):
        return False
    budget = BUDGET * car.owed * vehicle.period if car.kind == KIND.ROUND else INFINITE
    if take_another(b, n, tick, budget, traffic):
        return True
    if due and take_last_resort(b, n, traffic):
        return True
    if due:
        take_widest(b, n, traffic)
    return due


@jit_inline
def is_due(turn: int, bits: Any, vehicle: Vehicle) -> bool:
    """Tell whether an e-agent whose turn it is has to enter now, or it loses its place a second time."""
    if bits & FLAG.FORFEITED == 0:
        return False
    forfeit = ticks_of(vehicle.forfeit, vehicle)
    since = turn - forfeit if turn >= forfeit else turn
    return since > ticks_of(DUTY * vehicle.forfeit, vehicle)


@jit_rare
def before_ego(b: int, n: int, near: int, traffic: Traffic) -> bool:
    """Tell whether the ego comes behind a nemesis outside the discs, and no other car has to get out of a disc."""
    state, labels, roads, drivers, scratch = (
        traffic.state, traffic.labels, traffic.roads, traffic.drivers, traffic.scratch,
    )  # fmt: skip
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
        if scratch.near[k] != 0 and labels.crosses[b, scratch.near[k]] == v:
            return False
    its = labels.lane[b, 0]
    behind = dx * state.c[b, n] + dy * state.s[b, n] < 0.0
    comes = its >= 0 and lane_end(roads, net, its) == v
    return behind and (its == lane or comes or labels.crosses[b, 0] == v)
