"""Decides whether a passing car goes on and where it returns, as what it passes may drive on (compiled)."""

from __future__ import annotations

from dubins_traffic.kernels.compile import jit, jit_inline, jit_rare
from dubins_traffic.policies.rules.narrow import EDGE, within_lane
from dubins_traffic.policies.rules.passing import BACK, BERTH, SLIP, along, aside, stop_line
from dubins_traffic.policies.rules.tables import Driver, Traffic, Vehicle
from dubins_traffic.policies.rules.turn_arcs import ReferencePath
from dubins_traffic.roads.lookup import INFINITE
from dubins_traffic.rules.propositions import FLAG

SLOW = 0.05
"""A car slower than this, m/s, is passed to the end once that has begun, even if it waits for its turn by now."""
NARROWLY = 0.02
"""Distance from the disc that a car keeps which goes straight to the right, metres."""


@jit_inline
def last_return(vehicle: Vehicle) -> float:
    """Return the last place, metres from the intersection, negative, where a car can still go straight to the right."""
    return -(vehicle.disc + vehicle.reach + EDGE + NARROWLY)


@jit_rare
def keep_passing(b: int, n: int, speed: float, way: ReferencePath, near: int, traffic: Traffic) -> float:
    """Return the speed of a car that passes; end the manoeuvre when it is done or there is nothing left to pass.

    `near` (count) cars are listed.
    """
    state, labels, obstacles, drivers, scratch = (
        traffic.state, traffic.labels, traffic.obstacles, traffic.drivers, traffic.scratch,
    )  # fmt: skip
    vehicle = drivers.vehicle[b]
    car = drivers.car[b, n]
    here = along(way, state.x[b, n], state.y[b, n])
    left = aside(way, state.x[b, n], state.y[b, n])
    if here >= car.until:
        if abs(left) < 0.05:
            car.aside = 0.0
        elif labels.bits[b, n] & FLAG.LEFT != 0:
            pass_again(b, here, way, near, traffic, car, vehicle)
        return speed
    if labels.bits[b, n] & (FLAG.OVERTAKING | FLAG.LEFT) == 0 and not within_lane(car.aside, vehicle):
        car.aside = 0.0
        return speed
    length = 2.0 * vehicle.reach
    for p in range(obstacles.off[b], obstacles.off[b + 1]):
        part = obstacles.parts[p]
        key = along(way, part.x, part.y)
        if here - part.reach - length < key <= car.until + part.reach and abs(aside(way, part.x, part.y)) < 2.0:
            return speed
    beside = False
    before = False
    for k in range(near):
        j = scratch.near[k]
        key = along(way, state.x[b, j], state.y[b, j])
        its = aside(way, state.x[b, j], state.y[b, j])
        if its > vehicle.middle or abs(its) > 2.0 * vehicle.middle:
            continue
        waits = labels.bits[b, j] & FLAG.STANDS != 0
        stands = waits or abs(state.speed[b, j]) < SLOW
        if stands and here - length < key <= car.until:
            return speed
        if stands and abs(key - here) < (length + BERTH if waits else length):
            if goes_farther(key, vehicle, car):
                return speed
            if waits:
                car.until = -INFINITE  # It returns behind that one, which may wait for it.
                return speed
        if abs(key - here) < length + BERTH:
            beside = True
            before = before or key >= here - 0.1
    if not beside:
        car.aside = 0.0
        return speed
    return 0.0 if before else speed


@jit_inline
def goes_farther(key: float, vehicle: Vehicle, car: Driver) -> bool:
    """Let a car that passes go on past one that has moved up beside it and stands; tell if there is room.

    That is at `key` (m) along the lane.
    """
    until = min(key + SLIP + 2.0 * vehicle.half_length, last_return(vehicle))
    if until < key + vehicle.reach:
        return False
    car.until = max(car.until, until)
    return True


@jit
def pass_again(
    b: int, here: float, way: ReferencePath, near: int, traffic: Traffic, car: Driver, vehicle: Vehicle
) -> None:
    """Go on passing what has moved up meanwhile and stands where the car would return, if there is room.

    The car is at `here` (m) along the lane; `near` (count) cars are listed.
    """
    state, scratch = traffic.state, traffic.scratch
    length = 2.0 * vehicle.reach + BERTH
    for k in range(near):
        j = scratch.near[k]
        key = along(way, state.x[b, j], state.y[b, j])
        until = key + SLIP + 2.0 * vehicle.half_length
        beside = abs(aside(way, state.x[b, j], state.y[b, j])) < vehicle.middle and 0.0 < key - here < length
        if beside and abs(state.speed[b, j]) < SLOW and until + BACK <= stop_line(vehicle):
            car.until = until
