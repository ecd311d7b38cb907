"""Where a car gets past obstacles without leaving its lane to the left (compiled)."""

from __future__ import annotations

from dubins_traffic.cars.tables import ObstacleTable
from dubins_traffic.kernels.compile import jit, jit_rare
from dubins_traffic.policies.rules.tables import Traffic, Vehicle
from dubins_traffic.policies.rules.turn_arcs import ReferencePath
from dubins_traffic.roads.lookup import INFINITE, lane_coordinates, lane_direction

BESIDE = 0.06
"""Gap that a car keeps beside an obstacle, metres."""
SQUEEZED = 0.022
"""The same between two obstacles that leave no more room, metres."""
EDGE = 0.05
"""Distance that the centre keeps from the edge of the road, metres."""
TINY = 0.002
"""Least offset from its way of a car that passes within its lane, metres."""


@jit
def within_lane(offset: float, vehicle: Vehicle) -> bool:
    """Tell whether a body at `offset` left of the middle of the right lane does not reach over the centre line."""
    return offset + vehicle.half_width + vehicle.rounding <= vehicle.middle


@jit
def offset_on_way(
    b: int, way: ReferencePath, begin: float, end: float, obstacles: ObstacleTable, vehicle: Vehicle
) -> float:
    """Return `clear_offset` for the stretch from `begin` to `end` of the lane in which a way begins.

    Both are metres along the lane from its end, negative.
    """
    along = -(way.x * way.tx + way.y * way.ty)
    left = -(way.tx * way.y - way.ty * way.x) + way.middle
    return clear_offset(
        along, left, way.tx, way.ty, begin, end, obstacles, obstacles.off[b], obstacles.off[b + 1], vehicle
    )


@jit_rare
def offset_in_lane(
    traffic: Traffic, net: int, lane: int, begin: float, end: float, first: int, last: int, vehicle: Vehicle
) -> float:
    """Return `clear_offset` for a stretch of a lane from `begin` to `end`, metres along it; 0 if its road bends."""
    roads, obstacles = traffic.roads, traffic.obstacles
    if roads.segment[int(roads.seg_off[net]) + (lane >> 1)].piece >= 0:
        return 0.0
    along, left = lane_coordinates(roads, net, lane, 0.0, 0.0)
    tx, ty = lane_direction(roads, net, lane)
    return clear_offset(along, left + vehicle.middle, float(tx), float(ty), begin, end, obstacles, first, last, vehicle)


@jit
def clear_offset(
    along: float, left: float, tx: float, ty: float, begin: float, end: float, obstacles: ObstacleTable,
    first: int, last: int, vehicle: Vehicle,
) -> float:  # fmt: skip
    """Return how far left of the middle of its lane a car gets past all obstacles of a stretch, 0 if it can't.

    Its body stays clear of the centre line and its centre on the road; the car may pass between two obstacles. The
    origin of the plane lies `along` metres along the lane, which has the direction (`tx`, `ty`), and `left` metres
    left of its middle.
    """
    low, high = EDGE - vehicle.middle, vehicle.middle - vehicle.half_width - vehicle.rounding
    best = INFINITE
    for tight in range(2):
        wide = (SQUEEZED if tight == 1 else BESIDE) + vehicle.half_width + vehicle.rounding
        for p in range(first, last):
            part = obstacles.parts[p]
            key = along + tx * part.x + ty * part.y
            if not begin - vehicle.reach - part.reach < key < end + vehicle.reach + part.reach:
                continue
            its = left + tx * part.y - ty * part.x
            for side in range(2):
                offset = its - part.reach - wide if side == 0 else its + part.reach + wide
                near = abs(offset) < abs(best) and low <= offset <= high
                if near and is_clear(along, left, tx, ty, begin, end, offset, wide, obstacles, first, last, vehicle):
                    best = offset
        if best != INFINITE:
            return min(best, -TINY) if best < 0.0 else max(best, TINY)
    return 0.0


@jit_rare
def is_clear(
    along: float, left: float, tx: float, ty: float, begin: float, end: float, offset: float, wide: float,
    obstacles: ObstacleTable, first: int, last: int, vehicle: Vehicle,
) -> bool:  # fmt: skip
    """Tell whether all obstacles of a stretch are `wide` beside a car `offset` left of the middle of its lane."""
    for p in range(first, last):
        part = obstacles.parts[p]
        key = along + tx * part.x + ty * part.y
        if not begin - vehicle.reach - part.reach < key < end + vehicle.reach + part.reach:
            continue
        if abs(left + tx * part.y - ty * part.x - offset) < wide + part.reach - 1e-9:
            return False
    return True
