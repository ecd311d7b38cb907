"""Whether what a car passes is sure to stand in the next frame too, so that it may cross the centre line (compiled)."""

from __future__ import annotations

from dubins_traffic.kernels.compile import jit, jit_rare
from dubins_traffic.kernels.trig import advance
from dubins_traffic.policies.rules.passing import along, aside
from dubins_traffic.policies.rules.tables import Traffic
from dubins_traffic.policies.rules.turn_arcs import ReferencePath
from dubins_traffic.policies.safety import GUARD, travel_of
from dubins_traffic.roads.lookup import INFINITE
from dubins_traffic.rules.blocking import narrows
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.rules.shape import half_across, half_extent

LINE, SURE = 0.002, 0.03
"""Distance of the body from where it counts as left, and of what it passes from where that ends, metres."""
AHEAD = 1.0
"""What is farther ahead than this, beyond the bodies, does not keep a car from driving on in its lane, metres."""


@jit
def stays_right(b: int, n: int, speed: float, yaw_rate: float, way: ReferencePath, traffic: Traffic) -> bool:
    """Tell whether a command leaves the body in its lane, or the car overtakes in the next frame for certain."""
    state, labels, obstacles, drivers = traffic.state, traffic.labels, traffic.obstacles, traffic.drivers
    vehicle = drivers.vehicle[b]
    x, y, c, s = advance(state.x[b, n], state.y[b, n], state.c[b, n], state.s[b, n], speed, yaw_rate, vehicle.period)
    half = half_extent(way.tx, way.ty, c, s, vehicle)
    if aside(way, x, y) + half <= vehicle.middle + vehicle.over - LINE:
        return True
    if labels.bits[b, n] & FLAG.OVERTAKING == 0:
        return False
    here = along(way, x, y)
    for p in range(obstacles.off[b], obstacles.off[b + 1]):
        part = obstacles.parts[p]
        key = along(way, part.x, part.y)
        there = here - part.reach <= key <= here + part.reach + vehicle.fore
        if there and abs(aside(way, part.x, part.y)) - part.reach < vehicle.middle:
            return True
    return surely_stands(b, n, here, way, traffic)


@jit_rare
def becomes_left(b: int, n: int, speed: float, yaw_rate: float, way: ReferencePath, traffic: Traffic) -> bool:
    """Tell whether a command brings the body of a car so far over the centre line that the car is left."""
    state, vehicle = traffic.state, traffic.drivers.vehicle[b]
    x, y, c, s = advance(state.x[b, n], state.y[b, n], state.c[b, n], state.s[b, n], speed, yaw_rate, vehicle.period)
    return aside(way, x, y) + half_extent(way.tx, way.ty, c, s, vehicle) > vehicle.middle + vehicle.over


@jit
def surely_stands(b: int, n: int, here: float, way: ReferencePath, traffic: Traffic) -> bool:
    """Tell whether a car in the way of car n, `here` (m) along its lane in the next frame, will stand then too.

    A standing car may drive off. It also becomes excused, and then is no reason to overtake, when a car ahead of it
    gets its place in the order of the crossing.
    """
    state, labels, drivers, scratch = traffic.state, traffic.labels, traffic.drivers, traffic.scratch
    vehicle = drivers.vehicle[b]
    lane = drivers.car[b, n].lane
    if drivers.car[b, n].watched * vehicle.period < vehicle.stand_time + vehicle.period:
        return False
    watch_x, watch_y = drivers.car[b, n].watch_x, drivers.car[b, n].watch_y
    stands = False
    j = scratch.head[lane >> 1]
    while j >= 0:
        bits = labels.bits[b, j]
        if j != n and labels.lane[b, j] == lane and bits & (FLAG.APPROACH | FLAG.STOPPED) == FLAG.APPROACH:
            return False
        watched = state.x[b, j] == watch_x and state.y[b, j] == watch_y
        if j != n and bits & FLAG.STANDS != 0 and watched:
            key = along(way, float(state.x[b, j]), float(state.y[b, j]))
            left = aside(way, float(state.x[b, j]), float(state.y[b, j])) - vehicle.middle
            half = half_across(b, j, way.tx, way.ty, state, vehicle)
            if here - vehicle.behind + SURE < key < here + vehicle.fore - SURE:
                stands = stands or narrows(left - half, left + half, 2.0 * vehicle.middle, vehicle.needed)
        j = scratch.link[j]
    return stands


@jit_rare
def may_drive_on(b: int, n: int, way: ReferencePath, traffic: Traffic) -> bool:
    """Tell whether nothing is close ahead of a car where it is in its lane, so that it can pass what is beside it."""
    state, obstacles, drivers, scratch = traffic.state, traffic.obstacles, traffic.drivers, traffic.scratch
    vehicle = drivers.vehicle[b]
    here, left = along(way, state.x[b, n], state.y[b, n]), aside(way, state.x[b, n], state.y[b, n])
    wide = half_across(b, n, way.tx, way.ty, state, vehicle) + travel_of(vehicle) + GUARD
    far = 2.0 * vehicle.reach + AHEAD
    j = scratch.head[drivers.car[b, n].lane >> 1]
    while j >= 0:
        key, its = (
            along(way, float(state.x[b, j]), float(state.y[b, j])),
            aside(way, float(state.x[b, j]), float(state.y[b, j])),
        )
        half = half_across(b, j, way.tx, way.ty, state, vehicle)
        if j != n and here < key < here + far and abs(its - left) < wide + half:
            return False
        j = scratch.link[j]
    for p in range(obstacles.off[b], obstacles.off[b + 1]):
        part = obstacles.parts[p]
        key, its = along(way, part.x, part.y), aside(way, part.x, part.y)
        if here < key < here + far + part.reach and abs(its - left) < wide + part.reach:
            return False
    return True


@jit_rare
def watch(b: int, n: int, who: int, traffic: Traffic) -> None:
    """Count for how long the car that may be passed has not moved: car `who`, the one watched so far, or one beside."""
    state, labels, car = traffic.state, traffic.labels, traffic.drivers.car[b, n]
    scratch, segment = traffic.scratch, car.lane >> 1
    j = scratch.head[segment]
    while j >= 0:
        if j != n and state.x[b, j] == car.watch_x and state.y[b, j] == car.watch_y:
            car.watched += 1
            return
        j = scratch.link[j]
    car.watched = 0
    nearest2 = INFINITE
    j = scratch.head[segment] if who < 0 else -1
    while j >= 0:
        dx, dy = state.x[b, j] - state.x[b, n], state.y[b, j] - state.y[b, n]
        if j != n and labels.bits[b, j] & FLAG.STANDS != 0 and dx * dx + dy * dy < nearest2:
            nearest2, who = dx * dx + dy * dy, j
        j = scratch.link[j]
    if who >= 0:
        car.watch_x, car.watch_y = state.x[b, who], state.y[b, who]
