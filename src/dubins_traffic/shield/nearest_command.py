"""Finds the command nearest to a given one with which the ego breaks none of rules 1 to 3 (compiled).

A car that stands breaks no rule and is never at fault. So a command is let through if, after one tick of it, the ego
can stand for ever (`shield.checks`): then no rule is broken whatever the others do within E1 and E2. There is
one exception: a car that is left of the centre line has to return. So the ego crosses that line only by commands of the
law of the road (`policies.rules.policy`), where the way back is sure (`shield.way_back`), and the law drives until the
ego is in its lane again.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dubins_traffic.cars.state import EGO, Command, Pose
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.compile import jit, jit_inline
from dubins_traffic.policies.rules.passing import along, find_way_past, passing_time
from dubins_traffic.policies.rules.seeing import list_cars, unlist_cars
from dubins_traffic.policies.rules.tables import Traffic, Vehicle
from dubins_traffic.policies.rules.turn_arcs import way_between
from dubins_traffic.policies.rules.unrolled import bends_ahead, put_back, unroll
from dubins_traffic.roads.lookup import lane_coordinates
from dubins_traffic.routing.lane_graph import nearest_stage
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.shield.checks import bounded, gather_close, may_touch, refusal
from dubins_traffic.shield.tables import MODE, REASON, ShieldTables
from dubins_traffic.shield.way_back import copy_memory, drive_alone, drive_by_law, surely_returns

HALVINGS = 6
"""Number of bisections by which the speed nearest to the given one is found."""
SHIFTS = 5
"""Number of yaw rates tried to either side: they differ from the given one by 1/2, 1/4 ... of the largest."""
STEPS = 4
"""Number of speeds tried with each of these yaw rates."""


@jit
def shield(tick: Any, sighted: bool, traffic: Traffic, shields: ShieldTables, commands: Floats) -> None:
    """Replace the command of each ego, `commands[:, 0]`, if it would break a rule.

    Parameters
    ----------
    tick : (B,)
        The present frame of each trial, -1 for those to leave alone. None may be left out.
    sighted : bool
        Whether the ego sees all cars that there are in `state`; else those within the sensing radius.
    traffic : Traffic
        The trials; its drivers are those of `tables.egos`.
    shields : ShieldTables
        Memory of the shields; `shields.ego["reason"]` tells afterwards why each has stepped in.
    commands : (B, N, 2)
        Speed, m/s, and yaw rate, rad/s, of every car.
    """
    for b in range(tick.shape[0]):
        if tick[b] >= 0:
            sight2 = -1.0 if sighted else shields.ego[b].sight2
            shield_trial(b, tick[b], sight2, traffic, shields, commands)


@jit
def shield_trial(b: int, tick: int, sight2: float, traffic: Traffic, shields: ShieldTables, commands: Floats) -> None:
    """Replace the command of the ego of trial b if it would break a rule; `sight2` (m2) as for `gather_close`."""
    state, labels, drivers, scratch = traffic.state, traffic.labels, traffic.drivers, traffic.scratch
    vehicle = drivers.vehicle[b]
    asked, asked_yaw = commands[b, EGO, 0], commands[b, EGO, 1]
    _remember(b, tick, traffic, shields)
    left = np.int64(labels.bits[b, EGO]) & FLAG.LEFT != 0
    law = _lawful(b, tick, left, sight2, traffic, shields, commands)
    if not left:
        shields.ego[b].kept = 0
    near = gather_close(b, state, sight2, vehicle, scratch)
    obeys = _may_obey(b, tick, sight2, law, near, traffic, shields)
    near = gather_close(b, state, sight2, vehicle, scratch)
    finite = asked - asked == 0.0 and asked_yaw - asked_yaw == 0.0
    wanted = bounded(asked, asked_yaw, vehicle) if finite else Command(0.0, 0.0)
    reason = REASON.NOTHING if finite else REASON.NUMBER
    if finite and not (obeys and _same(wanted, law)):
        reason = refusal(b, wanted.speed, wanted.yaw_rate, near, traffic, shields)
    shields.ego[b].reason = reason
    if reason == REASON.NOTHING:
        commands[b, EGO, 0] = asked
        commands[b, EGO, 1] = asked_yaw
    else:
        if left:
            wanted = law if obeys else Command(0.0, 0.0)
        else:
            wanted = _nearest(b, wanted, obeys, law, near, traffic, shields)
        commands[b, EGO, 0] = wanted.speed
        commands[b, EGO, 1] = wanted.yaw_rate
    obeyed = _same(wanted, law)
    passes = drivers.car[b, EGO].aside != 0.0 and not left
    shields.ego[b].strayed = 1 if passes and (shields.ego[b].strayed != 0 or not obeyed) else 0
    if not left and not obeyed:
        shields.ego[b].kept = 0


@jit_inline
def _same(one: Command, other: Command) -> bool:
    return one.speed == other.speed and one.yaw_rate == other.yaw_rate


@jit_inline
def _lawful(
    b: int, tick: int, left: bool, sight2: float, traffic: Traffic, shields: ShieldTables, commands: Floats
) -> Command:
    """Return the command of the law, within bounds; while the ego returns from the left, the rehearsed one."""
    state, labels, drivers = traffic.state, traffic.labels, traffic.drivers
    if left and shields.ego[b].kept != 0:
        copy_memory(b, drivers, shields.alone.traffic.drivers)
        pose = Pose(state.x[b, EGO], state.y[b, EGO], state.c[b, EGO], state.s[b, EGO])
        law = drive_alone(b, tick, labels.lane[b, EGO], pose, traffic, shields)
        copy_memory(b, shields.alone.traffic.drivers, drivers)
        return law
    drive_by_law(b, tick, sight2, traffic, commands)
    return bounded(commands[b, EGO, 0], commands[b, EGO, 1], drivers.vehicle[b])


@jit_inline
def _remember(b: int, tick: int, traffic: Traffic, shields: ShieldTables) -> None:
    """Keep the greatest progress as the labeller does; at the start, set the law's first goal, the nearest."""
    state, labels, roads, drivers = traffic.state, traffic.labels, traffic.roads, traffic.drivers
    ego = shields.ego[b]
    lane = labels.lane[b, EGO]
    if lane >= 0:
        progress, _ = lane_coordinates(roads, drivers.net[b], lane, state.x[b, EGO], state.y[b, EGO])
        top = ego.top
        if ego.last_tick != tick - 1 and tick > 0:
            ego.top = progress + ego.turn_back
            ego.kept = 0
        elif tick == 0 or lane != ego.last_lane or ego.last_at >= 0 or progress > top:
            ego.top = progress
    ego.last_tick = tick
    ego.last_lane = lane
    ego.last_at = labels.at[b, EGO]
    if ego.aimed == 0:
        ego.aimed = 1
        car = drivers.car[b, EGO]
        car.place = nearest_stage(
            drivers.distance, car.first, car.last, lane, labels.segment[b, EGO]
        )  # fmt: skip


@jit_inline
def _may_obey(
    b: int, tick: int, sight2: float, law: Command, near: int, traffic: Traffic, shields: ShieldTables
) -> bool:
    """Tell whether the ego may do as the law says though that makes it left: its way back in time is sure enough."""
    drivers = traffic.drivers
    if may_touch(b, law.speed, law.yaw_rate, near, traffic, drivers.vehicle[b]):
        return False
    if np.int64(traffic.labels.bits[b, EGO]) & FLAG.LEFT != 0:
        return True
    reason = refusal(b, law.speed, law.yaw_rate, near, traffic, shields)
    if reason != REASON.LANE:
        return reason == REASON.NOTHING
    mode = shields.ego[b].mode
    if drivers.car[b, EGO].aside == 0.0 or mode == MODE.NEVER:
        return False
    if mode == MODE.LAW:
        return _has_way_back(b, sight2, traffic, shields)
    sure = surely_returns(b, tick, law.speed, law.yaw_rate, sight2, traffic, shields)
    shields.ego[b].kept = 1 if sure else 0
    return sure


@jit_inline
def _has_way_back(b: int, sight2: float, traffic: Traffic, shields: ShieldTables) -> bool:
    """Tell whether an ego that passes something can be back in time, by the law's own estimate."""
    state, roads, drivers = traffic.state, traffic.roads, traffic.drivers
    car = drivers.car[b, EGO]
    vehicle = drivers.vehicle[b]
    way = way_between(roads, drivers.net[b], car.lane, car.next_lane, vehicle.middle, vehicle.disc)
    unrolled = bends_ahead(b, EGO, traffic)
    if unrolled:
        unroll(b, EGO, traffic)
    if shields.ego[b].strayed != 0:
        waited = car.waited
        car.aside = 0.0
        list_cars(b, sight2, traffic)
        find_way_past(b, EGO, way, -1, traffic)
        unlist_cars(b, traffic)
        car.waited = waited
    here = along(way, state.x[b, EGO], state.y[b, EGO])
    time = passing_time(here, car.until, traffic.scratch.tight[0], vehicle)
    if unrolled:
        put_back(b, traffic)
    return car.aside != 0.0 and time <= shields.ego[b].left_time


@jit_inline
def _nearest(
    b: int, refused: Command, obeys: bool, law: Command, near: int, traffic: Traffic, shields: ShieldTables
) -> Command:
    """Return, for an ego that is not left, the command nearest to a refused one among those that are tried.

    Distance is that of (speed, yaw rate) in units of the largest speed and yaw rate. To stand is always possible.
    """
    drivers = traffic.drivers
    vehicle = drivers.vehicle[b]
    best = _slower(b, refused, near, traffic, shields)
    least = _apart(refused, best, vehicle)
    if obeys and _apart(refused, law, vehicle) < least:
        best = law
        least = _apart(refused, law, vehicle)
    straight = bounded(refused.speed, 0.0, vehicle)
    if (
        vehicle.half_length > 0.0
        and _apart(refused, straight, vehicle) < least
        and refusal(b, straight.speed, 0.0, near, traffic, shields) == REASON.NOTHING
    ):
        best = straight
        least = _apart(refused, straight, vehicle)
    shift = vehicle.yaw_most
    for _ in range(SHIFTS):
        shift *= 0.5
        for side in range(2):
            for k in range(STEPS):
                yaw_rate = refused.yaw_rate + shift if side == 0 else refused.yaw_rate - shift
                tried = bounded(refused.speed * (1.0 - 0.25 * k), yaw_rate, vehicle)
                far = _apart(refused, tried, vehicle)
                if far >= least:
                    break
                if refusal(b, tried.speed, tried.yaw_rate, near, traffic, shields) == REASON.NOTHING:
                    best, least = tried, far
                    break
    return best


@jit_inline
def _slower(b: int, refused: Command, near: int, traffic: Traffic, shields: ShieldTables) -> Command:
    """Return a refused command slowed down as little as needed on the same arc; (0, 0) if no speed will do."""
    drivers = traffic.drivers
    vehicle = drivers.vehicle[b]
    best = Command(0.0, 0.0)
    low, high = 0.0, 1.0
    share = 0.0
    for _ in range(HALVINGS + 1):
        tried = bounded(share * refused.speed, refused.yaw_rate, vehicle)
        if refusal(b, tried.speed, tried.yaw_rate, near, traffic, shields) == REASON.NOTHING:
            best = tried
            low = share
        else:
            high = share
        share = 0.5 * (low + high)
    return best


@jit_inline
def _apart(one: Command, other: Command, vehicle: Vehicle) -> float:
    """Return the squared distance of two commands in units of the car's bounds."""
    du = (one.speed - other.speed) / max(vehicle.fastest, -vehicle.slowest)
    dw = (one.yaw_rate - other.yaw_rate) / vehicle.yaw_most
    return du * du + dw * dw
