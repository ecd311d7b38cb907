"""Room in the lane behind a disc: how much there is, and which cars have to make some (compiled)."""

from __future__ import annotations

from math import sqrt
from typing import Any

from dubins_traffic.cars.state import EGO, Labels, State
from dubins_traffic.kernels.compile import jit, jit_inline, jit_rare
from dubins_traffic.policies.rules.kept import KeptPath
from dubins_traffic.policies.rules.narrow import offset_in_lane
from dubins_traffic.policies.rules.seeing import BEYOND, BRISK, FACING_GAP, QUEUE_GAP, SIDE
from dubins_traffic.policies.rules.tables import Traffic, Vehicle
from dubins_traffic.roads.lookup import INFINITE, lane_coordinates, lane_direction, lane_end, lane_start
from dubins_traffic.rules.exits import LaneOut, takes_lane
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.rules.tables import GRAIN

MARGIN = 0.02
"""Distance that a car keeps from a disc that it may not enter, metres."""
OVER = 0.05
"""A car less than this beyond the centre line of a lane still counts as in it, metres, unless it is on the other lane
and not left: then it passes an obstacle within its own lane, or sways."""
PRESSED = 0.4
"""A car with another one this close behind it in the disc, metres, closes up, so that the other can leave the disc."""


@jit_inline
def queue_lengths(vehicle: Vehicle) -> tuple[float, float]:
    """Return how far from a disc's centre a car has left the disc, and how far apart waiting cars are, metres."""
    edge = vehicle.disc + vehicle.reach + vehicle.unsure + MARGIN
    mouth = sqrt(max(edge * edge - vehicle.middle * vehicle.middle, 0.0))
    return mouth, 2.0 * vehicle.reach + QUEUE_GAP


@jit
def has_room(b: int, n: int, out: int, inside: int, traffic: Traffic) -> bool:
    """Tell whether a car that takes the lane `out` can leave the disc at its beginning altogether.

    `inside` cars are still in the disc and will be before it.
    """
    return room_in(b, n, out, inside, traffic) >= 0.0


@jit
def room_in(b: int, n: int, out: int, inside: int, traffic: Traffic) -> float:
    """Return how far beyond the disc at its beginning a car can drive on the lane `out`, metres.

    It is negative if the car can't leave the disc. The cars in the lane are assumed to drive on until they stand close
    behind one another: behind a body that stands there now, behind an obstacle or before the next disc. A car that
    drives in the next disc has left the lane. The ego and `free` cars may not drive on; at a crossing, where a car
    whose exit is barred has to take another in time, they may even back up. `inside` cars are still in the disc and
    will be before this one.
    """
    state, labels, roads, drivers, scratch = (
        traffic.state, traffic.labels, traffic.roads, traffic.drivers, traffic.scratch,
    )  # fmt: skip
    net, vehicle = drivers.net[b], drivers.vehicle[b]
    mouth, pitch = queue_lengths(vehicle)
    start = lane_start(roads, net, out)
    end = lane_end(roads, net, out)
    crossing = roads.degree[roads.vert_off[net] + start] >= vehicle.degree
    tx, ty = lane_direction(roads, net, out)
    last = roads.segment[int(roads.seg_off[net]) + (out >> 1)].length - mouth
    last = min(last, before_obstacles(b, out, traffic))
    wall = INFINITE
    for look in range(2):
        j = scratch.head[out >> 1]
        while j >= 0:
            along, aside = lane_coordinates(roads, net, out, float(state.x[b, j]), float(state.y[b, j]))
            strange = n != EGO and (j == EGO or drivers.car[b, j].whims != 0)
            gone = labels.at[b, j] == end and labels.bits[b, j] & FLAG.STANDS == 0 and not strange
            if j != n and not gone and takes_room(b, j, out, start, along, aside, labels, vehicle):
                if look == 1:
                    last -= pitch if along < wall else 0.0
                    j = scratch.link[j]
                    continue
                heading = state.c[b, j] * tx + state.s[b, j] * ty
                if is_slow(b, j, heading, state) and along < mouth + pitch:
                    return -1.0
                if labels.bits[b, j] & FLAG.STANDS != 0 or heading < 0.0 or strange:
                    back = vehicle.backs_up if strange and crossing else 0.0
                    if n == EGO and labels.lane[b, j] == out ^ 1:  # it has to go back, as in `has_to_go_back`
                        back = FACING_GAP + BEYOND - QUEUE_GAP
                    wall = min(wall, along)
                    last = min(last, along - back - pitch)
            j = scratch.link[j]
    return last - pitch * inside - mouth


@jit_inline
def is_clear(b: int, n: int, way: KeptPath, labels: Labels, count: Any) -> bool:
    """Tell whether a car is certain to have room in its exit, without obstacles: all cars on that road are oncoming.

    `way` (row) is its row of `Drivers.way`; there are `count` (number) cars. What `has_room` would find with some more
    work is not looked for.
    """
    if way.roomy == 0:
        return False
    for j in range(count):
        there = labels.segment[b, j] == way.out >> 1 and j != n
        if there and (labels.lane[b, j] != way.out ^ 1 or labels.bits[b, j] & FLAG.LEFT != 0):
            return False
    return True


@jit_inline
def takes_room(
    b: int, j: Any, out: int, start: int, along: float, aside: float, labels: Labels, vehicle: Vehicle
) -> bool:
    """Tell whether car `j` (index), in the lane `out`, is in the way of those that come there from `start` (vertex)."""
    oncoming = labels.lane[b, j] == out ^ 1 and labels.bits[b, j] & FLAG.LEFT == 0
    there = aside < vehicle.half_width + vehicle.rounding + OVER and along > vehicle.disc
    return there and not oncoming and labels.crosses[b, j] != start


@jit_inline
def is_slow(b: int, j: Any, heading: float, state: State) -> bool:
    """Tell whether car `j` (index) makes no room soon; `heading` (cosine) is of its angle to the lane."""
    return abs(state.speed[b, j]) < BRISK or heading < 0.5


@jit_rare
def is_open(b: int, n: int, out: int, traffic: Traffic) -> bool:
    """Tell whether a car can leave the disc by the lane `out` for all that is there now, wherever that may stop."""
    state, labels, roads, drivers, scratch = (
        traffic.state, traffic.labels, traffic.roads, traffic.drivers, traffic.scratch,
    )  # fmt: skip
    net, vehicle = drivers.net[b], drivers.vehicle[b]
    mouth, pitch = queue_lengths(vehicle)
    start = lane_start(roads, net, out)
    tx, ty = lane_direction(roads, net, out)
    j = scratch.head[out >> 1]
    while j >= 0:
        along, aside = lane_coordinates(roads, net, out, float(state.x[b, j]), float(state.y[b, j]))
        heading = float(state.c[b, j] * tx + state.s[b, j] * ty)
        near = along < mouth + pitch and is_slow(b, j, heading, state)
        if j != n and near and takes_room(b, j, out, start, along, aside, labels, vehicle):
            return False
        j = scratch.link[j]
    return True


@jit_rare
def is_free(b: int, n: int, out: int, traffic: Traffic) -> bool:
    """Tell whether the exit into the lane `out` is free (E4): no car takes the lane near the disc at its beginning.

    Outside the disc that is as the referee has it. Who is in it and nearest to that road counts as in the lane, too.
    """
    state, labels, roads, drivers, scratch = (
        traffic.state, traffic.labels, traffic.roads, traffic.drivers, traffic.scratch,
    )  # fmt: skip
    net, vehicle = drivers.net[b], drivers.vehicle[b]
    start = lane_start(roads, net, out)
    corner = roads.vertex[int(roads.vert_off[net]) + start]
    far = vehicle.disc + vehicle.exit_room + GRAIN
    lane = LaneOut(int(net), out, 2.0 * vehicle.middle, vehicle.needed)
    j = scratch.head[out >> 1]
    while j >= 0:
        x, y = float(state.x[b, j]), float(state.y[b, j])
        dx, dy = x - corner.x, y - corner.y
        if j == n or dx * dx + dy * dy > far * far:
            takes = False
        elif labels.at[b, j] == start:
            _, aside = lane_coordinates(roads, net, out, x, y)
            takes = aside <= 0.0
        else:
            takes = takes_lane(b, int(j), lane, vehicle, state, labels, roads)
        if takes:
            return False
        j = scratch.link[j]
    return True


@jit
def before_obstacles(b: int, lane: int, traffic: Traffic) -> float:
    """Return how far along a lane a car can drive before an obstacle that can't be passed in the lane, metres."""
    roads, obstacles, drivers = traffic.roads, traffic.obstacles, traffic.drivers
    vehicle = drivers.vehicle[b]
    free = INFINITE
    net, first, last = drivers.net[b], obstacles.off[b], obstacles.off[b + 1]
    for p in range(first, last):
        part = obstacles.parts[p]
        along, aside = lane_coordinates(roads, net, lane, part.x, part.y)
        wide = vehicle.half_width + vehicle.rounding + SIDE + part.reach
        if not (abs(aside + vehicle.middle) < wide and along + part.reach > vehicle.disc):
            continue
        begin, end = along - part.reach, along + part.reach
        if offset_in_lane(traffic, net, lane, begin, end, first, last, vehicle) == 0.0:
            free = min(free, begin - vehicle.reach - QUEUE_GAP)
    return free


@jit
def is_pressed(b: int, n: int, traffic: Traffic) -> bool:
    """Tell whether a car behind is still in the disc at the beginning of the lane, and needs room to leave it.

    It, or the cars between, are close behind one another already.
    """
    state, labels, roads, drivers, scratch = (
        traffic.state, traffic.labels, traffic.roads, traffic.drivers, traffic.scratch,
    )  # fmt: skip
    net, vehicle, lane = drivers.net[b], drivers.vehicle[b], drivers.car[b, n].lane
    v = lane_start(roads, net, lane)
    if labels.crosses[b, n] >= 0:
        return False
    way = drivers.way[b, n]
    here = (state.x[b, n] - way.x) * way.tx + (state.y[b, n] - way.y) * way.ty
    far = 2.0 * vehicle.reach + PRESSED
    j = scratch.head[lane >> 1]
    while j >= 0:
        along = (state.x[b, j] - way.x) * way.tx + (state.y[b, j] - way.y) * way.ty
        if j != n and labels.lane[b, j] == lane and labels.crosses[b, j] != v and along < here:
            far += 2.0 * vehicle.reach + QUEUE_GAP
        j = scratch.link[j]
    row = int(roads.vert_off[net]) + v
    for k in range(roads.degree[row]):
        j = scratch.head[roads.arms[row, k] >> 1]
        while j >= 0:
            dx = state.x[b, j] - state.x[b, n]
            dy = state.y[b, j] - state.y[b, n]
            if j != n and labels.crosses[b, j] == v and dx * dx + dy * dy < far * far:
                return True
            j = scratch.link[j]
    return False
