"""Where a point lies on a segment that bends, compiled: the same answers, bit for bit, as `roads.chains` gives."""

from __future__ import annotations

from math import sqrt

from dubins_traffic.kernels.arrays import INFINITE
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.records import Rows
from dubins_traffic.kernels.trig import angle
from dubins_traffic.roads.table import Piece, Segment


@jit
def piece_distance2(own: Piece, x: float, y: float) -> float:
    """Return the squared distance from a point to a piece."""
    rx = x - own.x
    ry = y - own.y
    qx = x - own.end_x
    qy = y - own.end_y
    if own.side == 0.0:
        along = rx * own.tx + ry * own.ty
        off = own.tx * ry - own.ty * rx
        beside = 0.0 <= along <= own.length
    else:
        ox = x - own.cx
        oy = y - own.cy
        off = sqrt(ox * ox + oy * oy) - own.radius
        beside = ox * own.tx + oy * own.ty >= 0.0 and ox * own.end_tx + oy * own.end_ty <= 0.0
    if beside:
        return off * off
    return min(rx * rx + ry * ry, qx * qx + qy * qy)


@jit
def nearest_piece(pieces: Rows[Piece], own: Segment, x: float, y: float) -> tuple[int, float]:
    """Return the row of the nearest piece of a segment that bends, the first of equally near ones; squared distance.

    `own` (row) is the segment.
    """
    best = own.piece
    least = INFINITE
    for k in range(own.piece, own.last + 1):
        d2 = piece_distance2(pieces[k], x, y)
        if d2 < least:
            best = k
            least = d2
    return best, least


@jit
def bent_distance2(pieces: Rows[Piece], own: Segment, x: float, y: float) -> float:
    """Return the squared distance from a point to a segment that bends, `own` (row)."""
    _, least = nearest_piece(pieces, own, x, y)
    return least


@jit
def bent_coordinates(
    pieces: Rows[Piece], own: Segment, back: bool, x: float, y: float
) -> tuple[float, float]:
    """Return (s, l) of a point on a lane of a segment that bends, `own` (row).

    The lane is that from its second to its first end if `back` (flag). Beyond the ends the first and the last
    line go on.
    """
    k, _ = nearest_piece(pieces, own, x, y)
    at = pieces[k]
    if at.side == 0.0:
        rx = x - at.x
        ry = y - at.y
        along = rx * at.tx + ry * at.ty
        left = at.tx * ry - at.ty * rx
    else:
        ox = x - at.cx
        oy = y - at.cy
        forth = max(ox * at.tx + oy * at.ty, 0.0)
        along = at.radius * angle(forth, at.side * (ox * at.ty - oy * at.tx))
        left = at.side * (at.radius - sqrt(ox * ox + oy * oy))
    if back:
        return at.rest - along, -left
    return at.base + along, left


@jit
def bent_direction(pieces: Rows[Piece], own: Segment, x: float, y: float) -> tuple[float, float]:
    """Return the unit vector along a segment that bends, `own` (row), where it is nearest to a point."""
    k, _ = nearest_piece(pieces, own, x, y)
    at = pieces[k]
    if at.side == 0.0:
        return at.tx, at.ty
    ox = x - at.cx
    oy = y - at.cy
    far = sqrt(ox * ox + oy * oy)
    if far == 0.0:
        return at.tx, at.ty
    return -at.side * oy / far, at.side * ox / far
