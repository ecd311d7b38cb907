"""Road networks as arrays for kernels."""

from __future__ import annotations

from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.records import Rows, record
from dubins_traffic.kernels.tables import Tables


@record
class Segment:
    """A segment: its first end, the unit vector along it there, its length, its second end, m; its vertices."""

    x: float
    y: float
    tx: float
    ty: float
    length: float
    end_x: float
    end_y: float
    first: int
    second: int
    end_tx: float
    """The unit vector along it at its second end: the same, unless the segment bends."""
    end_ty: float
    piece: int
    """Row of its first piece in `RoadTable.piece`, -1 for a straight segment."""
    last: int
    """Row of its last piece."""


@record
class Piece:
    """A line or an arc of a segment that bends, m: from where to where, and the unit vectors along it there."""

    x: float
    y: float
    tx: float
    ty: float
    end_x: float
    end_y: float
    end_tx: float
    end_ty: float
    length: float
    base: float
    """Length of the segment before it."""
    rest: float
    """Length of the segment from where it begins."""
    cx: float
    cy: float
    """Centre of an arc."""
    radius: float
    """Of an arc, 0 for a line."""
    side: float
    """1 for an arc that turns left, -1 right, 0 for a line."""


@record
class Vertex:
    """An intersection, m."""

    x: float
    y: float


@record
class CellGrid:
    """The cells of a network: cell (cx, cy) is number first + cy * nx + cx; the finer ones of `pave` are alike."""

    x0: float
    """Lower corner of the box of cells, m."""
    y0: float
    scale: float
    """1 / side of a cell, 1/m."""
    nx: int
    """Columns of cells."""
    ny: int
    first: int
    pave_scale: float
    """1 / side of a cell of `pave`, 1/m."""
    pave_nx: int
    pave_ny: int
    pave_first: int


class RoadTable(Tables):
    """K networks, one after another; segments, intersections and lanes are numbered within their network.

    Attributes
    ----------
    half_width : array (K,)
        Half the width of the roads, 2w, metres.
    seg_off : array (K + 1,)
        First row of each network in `segment` and `ends`.
    segment : table (S,) of Segment
        The segments.
    piece : table (P,) of Piece
        The pieces of the segments that bend.
    ends : array (S, 2)
        Intersections at the ends.
    vert_off : array (K + 1,)
        First row of each network in `vertex`, `arms` and `degree`.
    vertex : table (V,) of Vertex
        The intersections.
    arms : array (V, 4)
        Lanes out of an intersection, counter-clockwise, then -1.
    degree : array (V,)
        Number of roads at an intersection.
    grid : table (K,) of CellGrid
        The cells.
    seg_start, vert_start : arrays (C + 1,)
        Where the candidates of each cell begin in `seg_item`, `vert_item`.
    seg_item, vert_item : arrays
        What may be nearest to a point of the cell, in ascending order.
    pave : array
        What the road makes of a cell: a segment, or a `lookup.CELL`.
    """

    half_width: Floats
    seg_off: Ints
    segment: Rows[Segment]
    piece: Rows[Piece]
    ends: Ints
    vert_off: Ints
    vertex: Rows[Vertex]
    arms: Ints
    degree: Ints
    grid: Rows[CellGrid]
    seg_start: Ints
    seg_item: Ints
    vert_start: Ints
    vert_item: Ints
    pave: Ints
