"""Choices that tables make for e-agents of the kind `chosen` where the law leaves them free, leg by leg (compiled).

A leg begins when the car takes a lane, and ends when it takes the next one; the first has number 0. `Drivers.choice`
has a row for each of the first legs of a car (`tables.Leg`); where that has NaN, the car drives as the law says. All
else (the order of arrival, room behind a disc, what is ahead) is always the law's.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from dubins_traffic.cars.state import Labels
from dubins_traffic.kernels.compile import jit_inline, jit_rare
from dubins_traffic.policies.rules.tables import Driver, Traffic, Vehicle
from dubins_traffic.roads.lookup import lane_end
from dubins_traffic.rules.propositions import FLAG

HALF_WAY: Final = 0.5
BEFORE_APPROACH: Final = 0.1
"""A car pauses at least this far before it takes its place in the order of a crossing, metres."""

PASSES: Final = 8.0
"""How near a car is that passes, in units of a body's farthest point."""


@jit_rare
def choose(b: int, n: int, barred: float, traffic: Traffic) -> None:
    """Begin the next leg of a car that has taken a lane and its exit: apply the choices for it.

    `scratch.cost` holds the costs of the exits; one of cost `barred` (m) or more is not taken.
    """
    roads, drivers, scratch = traffic.roads, traffic.drivers, traffic.scratch
    car = drivers.car[b, n]
    car.leg += 1
    car.speed, car.pause, car.line_hold, car.keeps = car.usual_speed, 0.0, 0.0, 0.0
    if car.leg >= car.choices:
        return
    choice = drivers.choice[car.choice + car.leg]
    car.speed = _chosen(choice.speed, car.usual_speed)
    car.pause = _chosen(choice.pause, 0.0)
    car.pause_at = _chosen(choice.pause_at, HALF_WAY)
    car.line_hold = _chosen(choice.hold, 0.0)
    car.hold = _chosen(choice.dwell, car.hold)
    car.keeps = _chosen(choice.gap, 0.0)
    place = int(roads.vert_off[drivers.net[b]]) + lane_end(roads, drivers.net[b], car.lane)
    degree = int(roads.degree[place])
    wish = int(_chosen(choice.exit, -1.0))
    if wish < 0 or degree < drivers.vehicle[b].degree or degree < 3:
        return
    for k in range(degree):
        if roads.arms[place, k] == car.lane ^ 1:
            wish += k
    wish %= degree
    if scratch.cost[wish] < barred:
        car.next_lane = int(roads.arms[place, wish])


@jit_inline
def _chosen(value: float, otherwise: float) -> float:
    """Return a value, or another one where it is not a number."""
    return value if value - value == 0.0 else otherwise


@jit_rare
def pauses(b: int, n: int, to_go: float, labels: Labels, traffic: Traffic) -> bool:
    """Tell whether a car pauses in its lane now by choice, and count the time.

    It does once it has driven its share of the lane, `to_go` (m) before the lane's end, and is outside discs, has no
    place in an order of arrival, and passes nothing. The time does not end while another e-agent passes.
    """
    roads, drivers = traffic.roads, traffic.drivers
    car = drivers.car[b, n]
    if car.pause <= 0.0 or labels.crosses[b, n] >= 0 or labels.lane[b, n] != car.lane or car.aside != 0.0:
        return False
    bits = np.int64(labels.bits[b, n])
    if bits & (FLAG.APPROACH | FLAG.STOPPED | FLAG.LEFT) != 0:
        return False
    vehicle = drivers.vehicle[b]
    length = roads.segment[int(roads.seg_off[drivers.net[b]]) + (car.lane >> 1)].length
    nearest = vehicle.disc + vehicle.reach + vehicle.approaches + BEFORE_APPROACH
    if to_go > max((1.0 - car.pause_at) * length, nearest):
        return False
    if car.pause > vehicle.period or not is_passed(b, n, labels, traffic):
        car.pause -= vehicle.period
    return True


@jit_inline
def is_passed(b: int, n: int, labels: Labels, traffic: Traffic) -> bool:
    """Tell whether another e-agent is passing a car, which would keep it on the left if it drove off now."""
    state = traffic.state
    far = PASSES * traffic.drivers.vehicle[b].reach
    passed = False
    for j in range(1, state.count[b]):
        dx = state.x[b, j] - state.x[b, n]
        dy = state.y[b, j] - state.y[b, n]
        near = j != n and labels.lane[b, j] == labels.lane[b, n] and dx * dx + dy * dy < far * far
        passed = passed or (near and np.int64(labels.bits[b, j]) & FLAG.LEFT != 0)
    return passed


@jit_inline
def holds(car: Driver, vehicle: Vehicle) -> bool:
    """Tell whether a car whose turn it is still waits at the line by choice."""
    return car.owed * vehicle.period <= car.line_hold


@jit_inline
def keeps_own_gap(b: int, n: int, who: int, labels: Labels, car: Driver) -> bool:
    """Tell whether car `who` (index) is in a car's own lane, outside discs, so that the gap to it may be chosen."""
    ahead = labels.lane[b, who] == car.lane and labels.crosses[b, who] < 0
    return ahead and labels.lane[b, n] == car.lane and labels.crosses[b, n] < 0
