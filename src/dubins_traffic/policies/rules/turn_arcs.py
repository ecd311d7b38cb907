"""The way through an intersection as numbers: straight on, or the arc that joins the middles of two right lanes.

All arcs at one intersection from the same arm begin equally far from it. Where two cars pass a bend in opposite
directions their arcs have the same centre, and stay a lane's width apart.
"""

from __future__ import annotations

from math import sqrt
from typing import Final, NamedTuple

from dubins_traffic.kernels.compile import jit, jit_inline
from dubins_traffic.roads.lookup import lane_direction, lane_end, lane_end_direction
from dubins_traffic.roads.table import RoadTable

STRAIGHT = 0.01
"""Sine of the angle between two lanes below which the way is straight."""
BEGIN = 0.8
"""Arcs begin this far from the intersection along the lanes, in units of the radius R of its disc."""
NO_DIRECTION = 1e-150
"""A vector shorter than this, metres, has no direction: its square has lost digits, or is 0."""
TIGHTEST = 0.05
"""Least radius of an arc, metres."""


class _Part(NamedTuple):
    """Where a point lies on a way."""

    BEFORE: int = 0
    """On the lane in."""
    THROUGH: int = 1
    """In the arc."""
    AFTER: int = 2
    """On the lane out."""


PART: Final = _Part()


class ReferencePath(NamedTuple):
    """The way from a lane to another through the intersection at (x, y).

    (tx, ty) and (ux, uy) are the directions of the lane in and the lane out, (cx, cy) the centre of the arc and
    `radius` its radius; `side` is 1 for a turn to the left, -1 to the right, 0 straight on; `bend` is side / radius,
    0 straight on. `middle` is how far right of the centre line lanes are driven, metres.
    """

    x: float
    y: float
    tx: float
    ty: float
    ux: float
    uy: float
    cx: float
    cy: float
    radius: float
    side: float
    middle: float
    bend: float


@jit
def way_between(roads: RoadTable, net: int, lane: int, out: int, middle: float, disc: float) -> ReferencePath:
    """Return the way from `lane` to `out`, which begins where it ends (`lane ^ 1`: turning round to the left).

    Parameters
    ----------
    roads, net
        The roads.
    lane, out
        Two lanes.
    middle
        How far right of the centre line lanes are driven, metres.
    disc
        R, metres.
    """
    row = int(roads.vert_off[net]) + lane_end(roads, net, lane)
    x = roads.vertex[row].x
    y = roads.vertex[row].y
    tx, ty = lane_end_direction(roads, net, lane)
    ux, uy = lane_direction(roads, net, out)
    sine = tx * uy - ty * ux
    cosine = tx * ux + ty * uy
    begin = BEGIN * disc
    if out == lane ^ 1:
        side = 1.0
        cot = 0.0
        radius = middle
    elif abs(sine) < STRAIGHT and cosine > 0.0:
        return ReferencePath(x, y, tx, ty, ux, uy, x, y, 0.0, 0.0, middle, 0.0)
    else:
        side = 1.0 if sine > 0.0 else -1.0
        cot = abs(sine) / (1.0 - cosine)
        radius = max(begin * cot + side * middle, TIGHTEST)
        if cot > 0.05:
            begin = (radius - side * middle) / cot
    px = x - begin * tx + middle * ty
    py = y - begin * ty - middle * tx
    cx = px - side * radius * ty
    cy = py + side * radius * tx
    return ReferencePath(x, y, tx, ty, ux, uy, cx, cy, radius, side, middle, side / radius)


@jit
def on_way(way: ReferencePath, x: float, y: float) -> tuple[int, float, float, float, float]:
    """Return (part, key, left, px, py) of a point.

    `part` is one of `PART`; `key` grows along each part; `left` is how far left of the way the point lies,
    metres, and (px, py) the direction of the way there.
    """
    tx, ty, ux, uy = way.tx, way.ty, way.ux, way.uy
    rx = x - way.x
    ry = y - way.y
    in_left = tx * ry - ty * rx + way.middle
    out_left = ux * ry - uy * rx + way.middle
    if way.side == 0.0:
        along = rx * tx + ry * ty
        if along < 0.0:
            return PART.BEFORE, along, in_left, tx, ty
        return PART.AFTER, along, out_left, ux, uy
    dx = x - way.cx
    dy = y - way.cy
    along = dx * tx + dy * ty
    past = dx * ux + dy * uy
    if along > 0.0 > past:
        return in_arc(way, dx, dy)
    if past < 0.0 or (along <= 0.0 and abs(in_left) < abs(out_left)):
        return PART.BEFORE, along, in_left, tx, ty
    return PART.AFTER, past, out_left, ux, uy


@jit_inline
def in_arc(way: ReferencePath, dx: float, dy: float) -> tuple[int, float, float, float, float]:
    """Return what `on_way` does, of a point that is known to be in the arc, `dx` (m) and `dy` (m) from its centre."""
    far = max(sqrt(dx * dx + dy * dy), NO_DIRECTION)
    ex = dx / far
    ey = dy / far
    side = way.side
    ahead = side * (ex * way.ty - ey * way.tx)
    return PART.THROUGH, 1.0 - ahead, side * (way.radius - far), -side * ey, side * ex


@jit
def on_lane(way: ReferencePath, x: float, y: float) -> tuple[int, float, float, float, float]:
    """Return what `on_way` does, of a point that is known to be on the lane in."""
    along = (x - way.cx) * way.tx + (y - way.cy) * way.ty
    left = way.tx * (y - way.y) - way.ty * (x - way.x) + way.middle
    return PART.BEFORE, min(along, -1e-9), left, way.tx, way.ty
