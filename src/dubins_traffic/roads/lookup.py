"""Where a point lies on a network.

Functions take the table `t` of `packing.pack` and the number `net` of a network in it; segments, intersections and
lanes are numbered within the network. Lane 2s runs along segment s, lane 2s + 1 back. Those of segments that bend take
the rows of their pieces.
"""

from __future__ import annotations

from math import sqrt
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from dubins_traffic.kernels.arrays import INFINITE, Floats, Ints
from dubins_traffic.kernels.compile import jit, jit_inline, jit_rare
from dubins_traffic.kernels.records import Rows, record
from dubins_traffic.kernels.trig import angle, sincos
from dubins_traffic.roads.table import Piece, RoadTable, Segment


class _Cell(NamedTuple):
    """What stands in a cell of `RoadTable.pave` in place of the number of the only segment whose road meets it."""

    OFF: int = -1
    """No point of it is on the road."""
    ON: int = -2
    """All are."""
    MIXED: int = -3
    """The roads of several segments meet it."""


CELL: Final = _Cell()

CERTAIN = 1e-6
"""What rounding can't make up, metres."""
FORKED = 1.2
"""Where the second segment is less than this farther than the nearest, metres, nearest is one of those at a vertex."""


@jit
def piece_distance2(piece: Piece, x: float, y: float) -> float:
    """Return the squared distance from a point to a piece."""
    rx = x - piece.x
    ry = y - piece.y
    qx = x - piece.end_x
    qy = y - piece.end_y
    if piece.side == 0.0:
        along = rx * piece.tx + ry * piece.ty
        off = piece.tx * ry - piece.ty * rx
        beside = 0.0 <= along <= piece.length
    else:
        ox = x - piece.cx
        oy = y - piece.cy
        off = sqrt(ox * ox + oy * oy) - piece.radius
        beside = ox * piece.tx + oy * piece.ty >= 0.0 and ox * piece.end_tx + oy * piece.end_ty <= 0.0
    if beside:
        return off * off
    return min(rx * rx + ry * ry, qx * qx + qy * qy)


@jit
def nearest_piece(pieces: Rows[Piece], segment: Segment, x: float, y: float) -> tuple[int, float]:
    """Return the row of the nearest piece of a segment that bends, the first of equally near ones; squared distance.

    `segment` (row) is the segment.
    """
    best = segment.piece
    least = INFINITE
    for k in range(segment.piece, segment.last + 1):
        d2 = piece_distance2(pieces[k], x, y)
        if d2 < least:
            best = k
            least = d2
    return best, least


@jit_rare
def bent_distance2(pieces: Rows[Piece], segment: Segment, x: float, y: float) -> float:
    """Return the squared distance from a point to a segment that bends, `segment` (row)."""
    _, least = nearest_piece(pieces, segment, x, y)
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
    pieces: Rows[Piece], segment: Segment, back: bool, x: float, y: float
) -> tuple[float, float, float, float]:
    """Return (s, l, unit vector along the lane there) of a point on a lane of a segment that bends, `segment` (row).

    The lane is that from its second to its first end if `back` (flag). Beyond the ends the first and the last
    line go on.
    """
    k, _ = nearest_piece(pieces, segment, x, y)
    along, left, tx, ty = piece_foot(pieces[k], x, y)
    if back:
        return pieces[k].rest - along, -left, -tx, -ty
    return pieces[k].base + along, left, tx, ty


@jit_rare
def bent_coordinates(pieces: Rows[Piece], segment: Segment, back: bool, x: float, y: float) -> tuple[float, float]:
    """Return (s, l) of a point on a lane of a `segment` (row) that bends, `back` (flag), as `bent_foot` does."""
    along, left, _, _ = bent_foot(pieces, segment, back, x, y)
    return along, left


@jit_rare
def bent_direction(pieces: Rows[Piece], segment: Segment, x: float, y: float) -> tuple[float, float]:
    """Return the unit vector along a segment that bends, `segment` (row), where it is nearest to a point."""
    k, _ = nearest_piece(pieces, segment, x, y)
    _, _, tx, ty = piece_foot(pieces[k], x, y)
    return tx, ty


@jit
def bent_place(pieces: Rows[Piece], segment: Segment, back: bool, along: float) -> tuple[float, float, float, float]:
    """Return (point, unit vector along the lane there) `along` (m) from the start of a lane of a segment that bends.

    `segment` (row) and `back` (flag) as for `bent_foot`; beyond the ends the first and the last line go on.
    """
    forth = segment.length - along if back else along
    k = segment.piece
    while k < segment.last and forth > pieces[k].base + pieces[k].length:
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


@jit_inline
def distance2(t: RoadTable, net: int, s: int, x: float, y: float) -> float:
    """Return the squared distance from a point to segment `s` (segment)."""
    row: int = t.seg_off[net] + s
    segment = t.segment[row]
    if segment.piece >= 0:
        return bent_distance2(t.piece, segment, x, y)
    rx = x - segment.x
    ry = y - segment.y
    qx = x - segment.end_x
    qy = y - segment.end_y
    along = rx * segment.tx + ry * segment.ty
    across = segment.tx * ry - segment.ty * rx
    beyond = qx * qx + qy * qy if along >= segment.length else across * across
    return rx * rx + ry * ry if along <= 0.0 else beyond


@jit_inline
def cell_of(t: RoadTable, net: int, x: float, y: float) -> int:
    """Return the number of the cell that holds a point, -1 outside the box of cells."""
    grid = t.grid[net]
    u = (x - grid.x0) * grid.scale
    v = (y - grid.y0) * grid.scale
    if u >= 0.0 and v >= 0.0 and u < grid.nx and v < grid.ny:
        return grid.first + int(v) * grid.nx + int(u)
    return -1


@jit_inline
def nearest_segment(t: RoadTable, net: int, x: float, y: float) -> tuple[int, float]:
    """Return the nearest segment and the squared distance to it; the lower number of equally near ones."""
    cell = cell_of(t, net, x, y)
    first = 0
    last = t.seg_off[net + 1] - t.seg_off[net]
    if cell >= 0:
        first = t.seg_start[cell]
        last = t.seg_start[cell + 1]
    best = 0
    least = INFINITE
    for k in range(first, last):
        s = t.seg_item[k] if cell >= 0 else k
        d2 = distance2(t, net, s, x, y)
        if d2 < least:
            best = s
            least = d2
    return best, least


@jit_inline
def on_road(t: RoadTable, net: int, x: float, y: float) -> bool:
    """Whether a point lies within the roads' half width of a segment (its ends capped by discs)."""
    grid = t.grid[net]
    u = (x - grid.x0) * grid.pave_scale
    v = (y - grid.y0) * grid.pave_scale
    pave: int = CELL.MIXED
    if u >= 0.0 and v >= 0.0 and u < grid.pave_nx and v < grid.pave_ny:
        pave = int(t.pave[grid.pave_first + int(v) * grid.pave_nx + int(u)])
    least = INFINITE
    if pave == CELL.ON:
        least = 0.0
    elif pave >= 0:
        least = distance2(t, net, pave, x, y)
    elif pave == CELL.MIXED:
        _, least = nearest_segment(t, net, x, y)
    return least <= t.half_width[net] * t.half_width[net]


@jit_inline
def vertex_distance2(t: RoadTable, net: int, v: int, x: float, y: float) -> float:
    """Return the squared distance from a point to intersection v."""
    row: int = t.vert_off[net] + v
    vertex = t.vertex[row]
    rx = x - vertex.x
    ry = y - vertex.y
    return rx * rx + ry * ry


@jit_inline
def nearest_vertex(t: RoadTable, net: int, x: float, y: float) -> tuple[int, float]:
    """Return the nearest intersection and the squared distance to it; the lower number of equally near ones."""
    cell = cell_of(t, net, x, y)
    first = 0
    last = t.vert_off[net + 1] - t.vert_off[net]
    if cell >= 0:
        first = t.vert_start[cell]
        last = t.vert_start[cell + 1]
    best = 0
    least = INFINITE
    for k in range(first, last):
        v = t.vert_item[k] if cell >= 0 else k
        d2 = vertex_distance2(t, net, v, x, y)
        if d2 < least:
            best = v
            least = d2
    return best, least


@jit
def nearest_arm(t: RoadTable, net: int, v: int, x: float, y: float) -> tuple[int, float]:
    """Return the nearest of the segments that meet in intersection v, as `nearest_segment` does."""
    row = t.vert_off[net] + v
    best = 0
    least = INFINITE
    for k in range(t.degree[row]):
        s = t.arms[row, k] >> 1
        d2 = distance2(t, net, s, x, y)
        if d2 < least or (d2 == least and s < best):
            best = s
            least = d2
    return best, least


@jit_inline
def _nearest_vertices(t: RoadTable, net: int, cell: int, x: float, y: float) -> tuple[int, float, float]:
    """Return the nearest of the vertices listed in a cell; how far it is; how far the second is."""
    best = 0
    least = second = INFINITE
    for k in range(t.vert_start[cell], t.vert_start[cell + 1]):
        v = t.vert_item[k]
        d2 = vertex_distance2(t, net, v, x, y)
        if d2 < least:
            best = v
        second = min(second, max(d2, least))
        least = min(d2, least)
    return best, sqrt(least), sqrt(second)


@jit_inline
def _nearest_segments(t: RoadTable, net: int, cell: int, v: int, x: float, y: float) -> tuple[int, float, float, float]:
    """Return the nearest of the segments listed in a cell; how far it is, the second, and the nearest not at v."""
    best = 0
    least = second = other = INFINITE
    for k in range(t.seg_start[cell], t.seg_start[cell + 1]):
        s = t.seg_item[k]
        d2 = distance2(t, net, s, x, y)
        if d2 < least:
            best = s
        second = min(second, max(d2, least))
        least = min(d2, least)
        row: int = t.seg_off[net] + s
        segment = t.segment[row]
        if v not in (segment.first, segment.second):
            other = min(other, d2)
    return best, sqrt(least), sqrt(second), sqrt(other)


@record
class ValidCell:
    """A rectangle in which the nearest segment and the nearest vertex do not change, its edges not included; metres."""

    low_x: float
    high_x: float
    low_y: float
    high_y: float
    segment: int
    """The nearest segment; -1: it is always one of the roads that meet in the vertex."""
    vertex: int


@jit
def valid_cell(t: RoadTable, net: int, x: float, y: float, radius: float, cell: ValidCell) -> None:
    """Write a rectangle about a point, in which nearest segment and vertex do not change, and these into `cell`.

    The rectangle lies within the cell of the point, and within the disc in which nothing else can become nearest. It
    is empty outside the box of cells. Where it would be small since roads meet, `cell.segment` is -1 instead: nearest
    is always one of the roads that meet in the vertex. Another vertex may become nearest as long as all are more than
    `radius` (m) away.
    """
    cell.low_x = cell.high_x = cell.low_y = cell.high_y = 0.0
    number = cell_of(t, net, x, y)
    if number < 0:
        s, _ = nearest_segment(t, net, x, y)
        v, _ = nearest_vertex(t, net, x, y)
        cell.segment = s
        cell.vertex = v
        return
    vertex, near, second = _nearest_vertices(t, net, number, x, y)
    spare = max(second - near, 2.0 * (near - radius))
    segment, near, second, other = _nearest_segments(t, net, number, vertex, x, y)
    if second - near < FORKED and near < other:
        segment = -1
        second = other
    half = 0.7 * 0.5 * min(spare, second - near) - CERTAIN
    grid = t.grid[net]
    side = 1.0 / grid.scale
    left = grid.x0 + side * int((x - grid.x0) * grid.scale)
    low = grid.y0 + side * int((y - grid.y0) * grid.scale)
    cell.low_x = max(x - half, left + CERTAIN)
    cell.high_x = min(x + half, left + side - CERTAIN)
    cell.low_y = max(y - half, low + CERTAIN)
    cell.high_y = min(y + half, low + side - CERTAIN)
    cell.segment = segment
    cell.vertex = vertex


@jit_inline
def lane_coordinates(t: RoadTable, net: int, lane: int, x: float, y: float) -> tuple[float, float]:
    """Return (s, l) of a point: metres along a lane from its start, metres left of the segment's centre line.

    Norm: docs/rules.md#segment.
    """
    row: int = t.seg_off[net] + (lane >> 1)
    segment = t.segment[row]
    if segment.piece >= 0:
        return bent_coordinates(t.piece, segment, lane & 1 != 0, x, y)
    rx = x - segment.x
    ry = y - segment.y
    along = rx * segment.tx + ry * segment.ty
    left = segment.tx * ry - segment.ty * rx
    if lane & 1:
        return segment.length - along, -left
    return along, left


@jit_inline
def lane_direction(t: RoadTable, net: int, lane: int) -> tuple[float, float]:
    """Return the unit vector along a lane where it begins."""
    row: int = t.seg_off[net] + (lane >> 1)
    segment = t.segment[row]
    if lane & 1:
        return -segment.end_tx, -segment.end_ty
    return segment.tx, segment.ty


@jit_inline
def lane_end_direction(t: RoadTable, net: int, lane: int) -> tuple[float, float]:
    """Return the unit vector along a lane where it ends."""
    row: int = t.seg_off[net] + (lane >> 1)
    segment = t.segment[row]
    if lane & 1:
        return -segment.tx, -segment.ty
    return segment.end_tx, segment.end_ty


@jit_inline
def lane_direction_at(t: RoadTable, net: int, lane: int, x: float, y: float) -> tuple[float, float]:
    """Return the unit vector along a lane where its centre line is nearest to a point."""
    row: int = t.seg_off[net] + (lane >> 1)
    segment = t.segment[row]
    if segment.piece < 0:
        return lane_direction(t, net, lane)
    tx, ty = bent_direction(t.piece, segment, x, y)
    if lane & 1:
        return -tx, -ty
    return tx, ty


@jit_inline
def bends_before(t: RoadTable, net: int, lane: int, x: float, y: float) -> bool:
    """Tell whether the road of a lane bends between a point and the lane's end."""
    row: int = t.seg_off[net] + (lane >> 1)
    segment = t.segment[row]
    if segment.piece < 0:
        return False
    k, _ = nearest_piece(t.piece, segment, x, y)
    return k != (segment.piece if lane & 1 else segment.last)


@jit
def tightness(t: RoadTable, net: int, lane: int, width: float) -> float:
    """Return a `width` (m) in units of the least radius of a lane's road, 0 if that is straight."""
    row: int = t.seg_off[net] + (lane >> 1)
    segment = t.segment[row]
    most = 0.0
    if segment.piece >= 0:
        for k in range(segment.piece, segment.last + 1):
            if t.piece[k].side != 0.0:
                most = max(most, width / t.piece[k].radius)
    return most


@jit_inline
def straight_start(t: RoadTable, net: int, lane: int) -> float:
    """Return how far a lane runs straight from where it begins, metres."""
    row: int = t.seg_off[net] + (lane >> 1)
    segment = t.segment[row]
    if segment.piece < 0:
        return segment.length
    return t.piece[segment.last if lane & 1 else segment.piece].length


@jit_inline
def lane_length(t: RoadTable, net: int, lane: int) -> float:
    """Return the length of a lane, metres."""
    row: int = t.seg_off[net] + (lane >> 1)
    return t.segment[row].length


@jit_inline
def lane_start(t: RoadTable, net: int, lane: int) -> int:
    """Return the intersection in which a lane begins."""
    return t.ends[t.seg_off[net] + (lane >> 1), lane & 1]


@jit_inline
def lane_end(t: RoadTable, net: int, lane: int) -> int:
    """Return the intersection in which a lane ends."""
    return t.ends[t.seg_off[net] + (lane >> 1), 1 - (lane & 1)]


def nearest(t: RoadTable, points: npt.ArrayLike, *, vertices: bool = False) -> tuple[Ints, Floats]:
    """Return number of and squared distance to the nearest segment, or vertex, of points (..., 2); ties: the lower."""
    points = np.asarray(points, dtype=np.float64)
    flat = np.ascontiguousarray(points.reshape(-1, 2))
    number, square = np.empty(len(flat), dtype=np.int64), np.empty(len(flat))
    put_nearest(t, vertices, flat, number, square)
    return number.reshape(points.shape[:-1]), square.reshape(points.shape[:-1])


def coordinates(t: RoadTable, lane: int, points: npt.ArrayLike) -> tuple[Floats, Floats]:
    """Return (s, l) of points (..., 2) on a lane: metres along it, and left of the segment's centre line."""
    points = np.asarray(points, dtype=np.float64)
    flat = np.array(points.reshape(-1, 2), order="C")
    put_coordinates(t, lane, flat)
    return flat[:, 0].reshape(points.shape[:-1]), flat[:, 1].reshape(points.shape[:-1])


@jit
def put_nearest(t: RoadTable, vertices: bool, points: Floats, number: Ints, square: Floats) -> None:
    """Find what is nearest to points in the first network.

    Parameters
    ----------
    t : RoadTable
        The roads.
    vertices : bool
        Whether intersections are sought, else segments.
    points : (N, 2) float64
        Points, m.
    number : (N,) int64
        Set to the numbers of what is nearest.
    square : (N,) float64
        Set to the squared distances, m^2.
    """
    for k in range(points.shape[0]):
        x, y = points[k, 0], points[k, 1]
        number[k], square[k] = nearest_vertex(t, 0, x, y) if vertices else nearest_segment(t, 0, x, y)


@jit
def put_coordinates(t: RoadTable, lane: int, points: Floats) -> None:
    """Put lane coordinates in the place of points.

    Parameters
    ----------
    t : RoadTable
        The roads.
    lane : int
        A lane of the first network.
    points : (N, 2) float64
        Points, m; set to metres along the lane, and left of the centre line.
    """
    for k in range(points.shape[0]):
        points[k, 0], points[k, 1] = lane_coordinates(t, 0, lane, points[k, 0], points[k, 1])
