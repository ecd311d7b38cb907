"""Where a point lies on a segment that bends, compiled: the same answers, bit for bit, as `roads.chains` gives."""

from __future__ import annotations

from math import sqrt

from dubins_traffic.kernels.arrays import INFINITE
from dubins_traffic.kernels.compile import jit, jit_rare
from dubins_traffic.kernels.records import Rows
from dubins_traffic.kernels.trig import angle, sincos
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


@jit_rare
def bent_distance2(pieces: Rows[Piece], own: Segment, x: float, y: float) -> float:
    """Return the squared distance from a point to a segment that bends, `own` (row)."""
    _, least = nearest_piece(pieces, own, x, y)
    return least


@jit
def piece_foot(at: Piece, x: float, y: float) -> tuple[float, float, float, float]:
    """Return (metres along a piece, metres left of it, unit vector along it there) of a point; a line goes on."""
    if at.side == 0.0:
        rx = x - at.x
        ry = y - at.y
        return rx * at.tx + ry * at.ty, at.tx * ry - at.ty * rx, at.tx, at.ty
    ox = x - at.cx
    oy = y - at.cy
    forth = max(ox * at.tx + oy * at.ty, 0.0)
    along = at.radius * angle(forth, at.side * (ox * at.ty - oy * at.tx))
    far = sqrt(ox * ox + oy * oy)
    left = at.side * (at.radius - far)
    if far == 0.0:
        return along, left, at.tx, at.ty
    return along, left, -at.side * oy / far, at.side * ox / far


@jit
def bent_foot(
    pieces: Rows[Piece], own: Segment, back: bool, x: float, y: float
) -> tuple[float, float, float, float]:
    """Return (s, l, unit vector along the lane there) of a point on a lane of a segment that bends, `own` (row).

    The lane is that from its second to its first end if `back` (flag). Beyond the ends the first and the last
    line go on.
    """
    k, _ = nearest_piece(pieces, own, x, y)
    along, left, tx, ty = piece_foot(pieces[k], x, y)
    if back:
        return pieces[k].rest - along, -left, -tx, -ty
    return pieces[k].base + along, left, tx, ty


@jit_rare
def bent_coordinates(
    pieces: Rows[Piece], own: Segment, back: bool, x: float, y: float
) -> tuple[float, float]:
    """Return (s, l) of a point on a lane of a segment that bends, `own` (row), `back` (flag), as `bent_foot` does."""
    along, left, _, _ = bent_foot(pieces, own, back, x, y)
    return along, left


@jit_rare
def bent_direction(pieces: Rows[Piece], own: Segment, x: float, y: float) -> tuple[float, float]:
    """Return the unit vector along a segment that bends, `own` (row), where it is nearest to a point."""
    k, _ = nearest_piece(pieces, own, x, y)
    _, _, tx, ty = piece_foot(pieces[k], x, y)
    return tx, ty


@jit
def bent_place(
    pieces: Rows[Piece], own: Segment, back: bool, along: float
) -> tuple[float, float, float, float]:
    """Return (point, unit vector along the lane there) `along` (m) from the start of a lane of a segment that bends.

    `own` (row) and `back` (flag) as for `bent_foot`; beyond the ends the first and the last line go on.
    """
    forth = own.length - along if back else along
    k = own.piece
    while k < own.last and forth > pieces[k].base + pieces[k].length:
        k += 1
    at = pieces[k]
    gone = forth - at.base
    tx, ty = at.tx, at.ty
    x, y = at.x + gone * tx, at.y + gone * ty
    if at.side != 0.0:
        c, s = sincos(gone / at.radius)
        ahead = at.radius * s
        aside = at.side * at.radius * (1.0 - c)
        x, y = at.x + ahead * tx - aside * ty, at.y + ahead * ty + aside * tx
        s *= at.side
        tx, ty = c * tx - s * ty, c * ty + s * tx
    return (x, y, -tx, -ty) if back else (x, y, tx, ty)
