"""Lanes and ways that are barred: an obstacle is in the way and can't be passed (compiled)."""

from __future__ import annotations

from dubins_traffic.kernels.compile import jit, jit_inline
from dubins_traffic.policies.rules.narrow import BESIDE, EDGE, offset_in_lane
from dubins_traffic.policies.rules.passing import BERTH, NARROWS, SLIP, back_at, passing_time, stop_line
from dubins_traffic.policies.rules.seeing import OBSTACLE_GAP, QUEUE_GAP, SIDE
from dubins_traffic.policies.rules.tables import Traffic, Vehicle
from dubins_traffic.policies.rules.turn_arcs import on_way, way_between
from dubins_traffic.roads.lookup import INFINITE, lane_coordinates, lane_end, tightness

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
    tight = tightness(roads, net, lane, vehicle.middle)
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
        furthest = begin - vehicle.reach - SLIP
        until = end + SLIP + 2.0 * vehicle.half_length
        back = length + back_at(until - length, tight, vehicle)
        offset += BERTH + wide
        aside = offset > 3.0 * vehicle.middle - EDGE
        if aside or back > length + stop_line(vehicle) or furthest < vehicle.disc + vehicle.reach + EDGE:
            return True
        if passing_time(furthest, until, tight, vehicle) > vehicle.left_time:
            return True
        for p in range(first, last):
            along, left = lane_coordinates(roads, net, lane, obstacles.parts[p].x, obstacles.parts[p].y)
            far = vehicle.reach + obstacles.parts[p].reach
            beside = abs(left + vehicle.middle - offset) < wide + BESIDE + obstacles.parts[p].reach
            if furthest - far < along < back + far and left + vehicle.middle > 0.0 and beside:
                return True
    return False


@jit_inline
def nearest_bar(vehicle: Vehicle) -> float:
    """Return the least distance along a lane at which an obstacle leaves room for a car out of the disc, metres."""
    return vehicle.disc + 2.0 * vehicle.reach + EDGE + QUEUE_GAP


@jit
def has_place(b: int, lane: int, traffic: Traffic) -> bool:
    """Tell whether obstacles let a car leave the disc at the beginning of a lane, even if it gets no farther."""
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
    narrow = begin != INFINITE
    while narrow:
        narrow = False
        for p in range(first, last):
            along, left = lane_coordinates(roads, net, lane, obstacles.parts[p].x, obstacles.parts[p].y)
            size = obstacles.parts[p].reach
            in_way = abs(left + vehicle.middle) < wide + size and begin <= along - size <= end + NARROWS
            if in_way and along + size > end:
                end = along + size
                narrow = True
            if in_way:
                offset = max(offset, left + vehicle.middle + size)
    return begin, end, offset


@jit
def leads_nowhere(b: int, lane: int, traffic: Traffic) -> bool:
    """Tell whether all ways on from the end of a lane, or from the ends of the next lanes, are barred."""
    roads, net = traffic.roads, traffic.drivers.net[b]
    row = int(roads.vert_off[net]) + lane_end(roads, net, lane)
    shut = shut_exits(b, lane, traffic)
    for k in range(roads.degree[row]):
        out = int(roads.arms[row, k])
        if shut & (1 << k) == 0 and shut_exits(b, out, traffic) != all_exits(b, out, traffic):
            return False
    return True


@jit
def shut_exits(b: int, lane: int, traffic: Traffic) -> int:
    """Return the arms, one bit each, of the intersection at the end of a lane to which the way is barred."""
    roads, net = traffic.roads, traffic.drivers.net[b]
    row = int(roads.vert_off[net]) + lane_end(roads, net, lane)
    shut = 0
    for k in range(roads.degree[row]):
        shut |= 1 << k if is_shut(b, lane, int(roads.arms[row, k]), traffic) else 0
    return shut


@jit
def all_exits(b: int, lane: int, traffic: Traffic) -> int:
    """Return the bits of all arms of the intersection at the end of a lane."""
    roads, net = traffic.roads, traffic.drivers.net[b]
    return (1 << int(roads.degree[int(roads.vert_off[net]) + lane_end(roads, net, lane)])) - 1


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
