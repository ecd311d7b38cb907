"""Lanes and ways that obstacles bar: in which they are in the way and can't be passed (compiled)."""

from __future__ import annotations

from dubins_traffic.kernels.compile import jit, jit_inline
from dubins_traffic.policies.rules.narrow import BESIDE, EDGE, offset_in_lane
from dubins_traffic.policies.rules.passing import BACK, BERTH, NARROWS, SLIP, TURNING, stop_line
from dubins_traffic.policies.rules.seeing import OBSTACLE_GAP, QUEUE_GAP, SIDE
from dubins_traffic.policies.rules.tables import Traffic, Vehicle
from dubins_traffic.policies.rules.turn_arcs import on_way, way_between
from dubins_traffic.roads.lookup import INFINITE, lane_coordinates, lane_end

LATE, LAST = 0.85, 0.82
"""From where on, in units of R, a car that comes out of a disc can pass an obstacle behind it within the lane: so that
it need not come close to it, and at all."""


@jit
def is_barred(traffic: Traffic, net: int, lane: int, first: int, last: int, vehicle: Vehicle) -> bool:
    """Tell whether one of the obstacle parts `first` to `last` - 1 is in the way in a lane and can't be passed there.

    What `find_way_past` asks of cars that stand or come is left out: these go.
    """
    roads, obstacles = traffic.roads, traffic.obstacles
    length = roads.segment[int(roads.seg_off[net]) + (lane >> 1)].length
    wide = vehicle.half_width + vehicle.rounding
    done = 0.0
    early = LATE * vehicle.disc + vehicle.reach + QUEUE_GAP
    for _ in range(last - first):
        begin, end, offset = next_bar(traffic, net, lane, done, early, first, last, vehicle)
        if begin >= length:
            return False
        done = end + 1e-6
        if begin < nearest_bar(vehicle):
            return True
        own = begin - vehicle.reach - SLIP
        back = end + SLIP + 2.0 * vehicle.half_length + BACK
        offset += BERTH + wide
        aside = offset > 3.0 * vehicle.middle - EDGE
        if aside or back > length + stop_line(vehicle) or own < vehicle.disc + vehicle.reach + EDGE:
            return True
        if (back - own) / (0.8 * vehicle.fastest) + TURNING > vehicle.left_time:
            return True
        for p in range(first, last):
            along, left = lane_coordinates(roads, net, lane, obstacles.parts[p].x, obstacles.parts[p].y)
            far = vehicle.reach + obstacles.parts[p].reach
            beside = abs(left + vehicle.middle - offset) < wide + BESIDE + obstacles.parts[p].reach
            if own - far < along < back + far and left + vehicle.middle > 0.0 and beside:
                return True
    return False


@jit_inline
def nearest_bar(vehicle: Vehicle) -> float:
    """Return from where on an obstacle in a lane leaves room before it for a car that comes out of the disc, metres."""
    return vehicle.disc + 2.0 * vehicle.reach + EDGE + QUEUE_GAP


@jit
def has_place(b: int, lane: int, traffic: Traffic) -> bool:
    """Tell whether a car can leave the disc at the beginning of a lane for all obstacles, though it gets no farther."""
    roads, obstacles, drivers = traffic.roads, traffic.obstacles, traffic.drivers
    net, vehicle = drivers.net[b], drivers.vehicle[b]
    first, last = obstacles.off[b], obstacles.off[b + 1]
    early = LAST * vehicle.disc + vehicle.reach + OBSTACLE_GAP
    begin, _, _ = next_bar(traffic, net, lane, 0.0, early, first, last, vehicle)
    return begin >= min(nearest_bar(vehicle), roads.segment[int(roads.seg_off[net]) + (lane >> 1)].length)


@jit
def next_bar(
    traffic: Traffic, net: int, lane: int, done: float, early: float, first: int, last: int, vehicle: Vehicle
) -> tuple[float, float, float]:
    """Return what `next_narrow` does, of the next obstacles that can't be passed within the lane.

    None can that begins before `early`, metres along the lane.
    """
    begin, end, offset = next_narrow(traffic, net, lane, done, first, last, vehicle)
    while begin != INFINITE:
        within = offset_in_lane(traffic, net, lane, begin, end, first, last, vehicle) != 0.0
        if begin < early or not within:
            break
        begin, end, offset = next_narrow(traffic, net, lane, end + 1e-6, first, last, vehicle)
    return begin, end, offset


@jit
def next_narrow(
    traffic: Traffic, net: int, lane: int, done: float, first: int, last: int, vehicle: Vehicle
) -> tuple[float, float, float]:
    """Return (begin, end, left) of the next obstacles in the way in a lane, none of which begins before `done`.

    Obstacles that are too near to one another for a car to return in between are passed as one; they reach
    to `left`, metres left of the middle of the lane. Without any, they begin at infinity.
    """
    roads, obstacles = traffic.roads, traffic.obstacles
    begin = INFINITE
    wide = vehicle.half_width + vehicle.rounding + SIDE
    for p in range(first, last):
        along, left = lane_coordinates(roads, net, lane, obstacles.parts[p].x, obstacles.parts[p].y)
        size = obstacles.parts[p].reach
        if abs(left + vehicle.middle) < wide + size and along - size >= done:
            begin = min(begin, along - size)
    end = begin
    offset = -1.0
    found = begin != INFINITE
    while found:
        found = False
        for p in range(first, last):
            along, left = lane_coordinates(roads, net, lane, obstacles.parts[p].x, obstacles.parts[p].y)
            size = obstacles.parts[p].reach
            in_way = abs(left + vehicle.middle) < wide + size and begin <= along - size <= end + NARROWS
            if in_way and along + size > end:
                end = along + size
                found = True
            if in_way:
                offset = max(offset, left + vehicle.middle + size)
    return begin, end, offset


@jit
def leads_nowhere(b: int, lane: int, traffic: Traffic) -> bool:
    """Tell whether no way on from the end of a lane, nor from the end of the next, is free of what can't be passed."""
    roads, drivers = traffic.roads, traffic.drivers
    net = drivers.net[b]
    row = int(roads.vert_off[net]) + lane_end(roads, net, lane)
    shut = 0
    for k in range(roads.degree[row]):
        out = int(roads.arms[row, k])
        if is_shut(b, lane, out, traffic) or ends_there(b, out, traffic):
            shut += 1
    return shut == roads.degree[row]


@jit
def ends_there(b: int, lane: int, traffic: Traffic) -> bool:
    """Tell whether no way on from the end of a lane is free of obstacles that can't be passed."""
    roads, drivers = traffic.roads, traffic.drivers
    net = drivers.net[b]
    row = int(roads.vert_off[net]) + lane_end(roads, net, lane)
    shut = 0
    for k in range(roads.degree[row]):
        shut += 1 if is_shut(b, lane, int(roads.arms[row, k]), traffic) else 0
    return shut == roads.degree[row]


@jit
def is_shut(b: int, lane: int, out: int, traffic: Traffic) -> bool:
    """Tell whether an obstacle is in the way from a lane to the lane `out`, or can't be passed in that."""
    obstacles, drivers = traffic.obstacles, traffic.drivers
    net, vehicle = drivers.net[b], drivers.vehicle[b]
    if is_barred(traffic, net, out, obstacles.off[b], obstacles.off[b + 1], vehicle):
        return True
    return stands_in_disc(b, lane, out, traffic)


@jit
def stands_in_disc(b: int, lane: int, out: int, traffic: Traffic) -> bool:
    """Tell whether an obstacle is in the way through the disc from a lane to the lane `out`."""
    roads, obstacles, drivers = traffic.roads, traffic.obstacles, traffic.drivers
    net, vehicle = drivers.net[b], drivers.vehicle[b]
    way = way_between(roads, net, lane, out, vehicle.middle, vehicle.disc)
    wide = vehicle.half_width + vehicle.rounding + SIDE
    for p in range(obstacles.off[b], obstacles.off[b + 1]):
        part = obstacles.parts[p]
        dx, dy = part.x - way.x, part.y - way.y
        far = vehicle.disc + part.reach
        _, _, left, _, _ = on_way(way, part.x, part.y)
        if dx * dx + dy * dy < far * far and abs(left) < wide + part.reach:
            return True
    return False
