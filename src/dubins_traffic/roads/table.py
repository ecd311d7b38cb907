"""Road networks as arrays for kernels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
import numpy.typing as npt

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.records import Rows, join, record, table
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.roads.surface import Cells, RoadRaster, road_raster


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
        What the road makes of a cell, see `roads.surface`.
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


_NUMBERED = frozenset(
    {"seg_off", "segment", "piece", "vert_off", "vertex", "grid", "seg_start", "vert_start"}
)
"""What is not just put one after another where several networks are."""


def pack_distinct(networks: Sequence[RoadNetwork], half_widths: Sequence[float]) -> tuple[RoadTable, Ints]:
    """Return the table of the distinct pairs of network and half width, and the number of each trial's pair in it."""
    numbers: dict[tuple[int, float], int] = {}
    for network, width in zip(networks, half_widths, strict=True):
        numbers.setdefault((id(network), width), len(numbers))
    given = [numbers[id(network), width] for network, width in zip(networks, half_widths, strict=True)]
    first = [given.index(number) for number in range(len(numbers))]
    packed = pack([networks[k] for k in first], [half_widths[k] for k in first])
    return packed, np.array(given, dtype=np.int64)


def pack(networks: Sequence[RoadNetwork], half_widths: Sequence[float]) -> RoadTable:
    """Return the table of some networks with the half widths (2w, metres) of their roads.

    Raises
    ------
    InputError
        If there is no network, or not one half width for each.
    """
    if not networks or len(networks) != len(half_widths):
        expected = "one half width for each of at least one network"
        raise InputError("can't pack networks", value=(len(networks), len(half_widths)), expected=expected)
    tables = [_table(network, width) for network, width in zip(networks, half_widths, strict=True)]
    if len(tables) == 1:
        return tables[0]
    plain = {
        name: np.concatenate([getattr(own, name) for own in tables])
        for name in RoadTable.field_names
        if name not in _NUMBERED
    }
    return RoadTable(
        **plain,
        seg_off=_offsets([len(own.segment) for own in tables]),
        vert_off=_offsets([len(own.vertex) for own in tables]),
        segment=_joined_segments(tables),
        piece=join([own.piece for own in tables]),
        vertex=join([own.vertex for own in tables]),
        grid=_grids([own.grid for own in tables]),
        seg_start=_starts([own.seg_start for own in tables]),
        vert_start=_starts([own.vert_start for own in tables]),
    )


def _table(network: RoadNetwork, half_width: float) -> RoadTable:
    """Return the table of one network (kept for next time, never to be written to)."""
    key = RoadTable, half_width
    if key not in network.known:
        raster, cells = road_raster(network.surface, half_width), network.surface.cells
        network.known[key] = RoadTable(
            half_width=np.array([half_width], dtype=np.float64),
            seg_off=_offsets([len(network.segments)]),
            segment=_segments(network),
            piece=_pieces(network),
            ends=network.ends.copy(),
            vert_off=_offsets([len(network.points)]),
            vertex=_vertices(network),
            arms=_arms(network),
            degree=network.degrees.copy(),
            grid=_grid(cells, raster),
            seg_start=cells.seg_start,
            seg_item=cells.seg_item,
            vert_start=cells.vert_start,
            vert_item=cells.vert_item,
            pave=raster.pave,
        )
    return cast(RoadTable, network.known[key])


def _segments(network: RoadNetwork) -> Rows[Segment]:
    rows = table(Segment, len(network.segments))
    rows["x"], rows["y"] = network.points[network.ends[:, 0]].T
    rows["tx"], rows["ty"] = network.tangents.T
    rows["length"] = network.lengths
    rows["end_x"], rows["end_y"] = network.points[network.ends[:, 1]].T
    rows["first"], rows["second"] = network.ends.T
    rows["end_tx"], rows["end_ty"] = network.end_tangents.T
    rows["piece"] = rows["last"] = -1
    if not network.is_straight:
        first = network.chains.first
        rows["piece"] = np.where(network.bent, first[:-1], -1)
        rows["last"] = np.where(network.bent, first[1:] - 1, -1)
    return rows


def _joined_segments(tables: Sequence[RoadTable]) -> Rows[Segment]:
    """Return the segments of several networks one after another, their pieces numbered so, too."""
    rows = join([own.segment for own in tables])
    before = _offsets([len(own.piece) for own in tables])[:-1]
    shift = np.repeat(before, [len(own.segment) for own in tables])
    bent = rows["piece"] >= 0
    rows["piece"] += np.where(bent, shift, 0)
    rows["last"] += np.where(bent, shift, 0)
    return rows


def _pieces(network: RoadNetwork) -> Rows[Piece]:
    if network.is_straight:
        return table(Piece, 0)
    chains = network.chains
    rows = table(Piece, len(chains.owner))
    rows["x"], rows["y"] = chains.start.T
    rows["tx"], rows["ty"] = chains.tangent.T
    rows["end_x"], rows["end_y"] = chains.end.T
    rows["end_tx"], rows["end_ty"] = chains.end_tangent.T
    rows["cx"], rows["cy"] = chains.centre.T
    rows["length"], rows["base"], rows["radius"] = chains.length, chains.base, chains.radius
    rows["rest"] = chains.rest
    rows["side"] = chains.side
    return rows


def _vertices(network: RoadNetwork) -> Rows[Vertex]:
    rows = table(Vertex, len(network.points))
    rows["x"], rows["y"] = network.points.T
    return rows


def _grid(cells: Cells, raster: RoadRaster) -> Rows[CellGrid]:
    rows = table(CellGrid, 1)
    own = rows[0]
    own.x0, own.y0, own.scale, own.nx, own.ny = cells.x0, cells.y0, cells.scale, cells.nx, cells.ny
    own.pave_scale, own.pave_nx, own.pave_ny = raster.scale, raster.nx, raster.ny
    return rows


def _grids(grids: Sequence[Rows[CellGrid]]) -> Rows[CellGrid]:
    """Return the cells of several networks, numbered one after another."""
    rows = join(grids)
    rows["first"] = _offsets(rows["nx"] * rows["ny"])[:-1]
    rows["pave_first"] = _offsets(rows["pave_nx"] * rows["pave_ny"])[:-1]
    return rows


def _arms(network: RoadNetwork) -> Ints:
    rows = np.full((len(network.points), 4), -1, dtype=np.int64)
    for v in range(len(network.points)):
        out = network.arms(v)
        rows[v, : len(out)] = out
    return rows


def _offsets(counts: Sequence[int] | Ints) -> Ints:
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)


def _starts(starts: Sequence[npt.NDArray[np.int64]]) -> Ints:
    shift = _offsets([int(start[-1]) for start in starts])
    rows = [start[:-1] + shift[k] for k, start in enumerate(starts)]
    return np.concatenate([*rows, shift[-1:]]).astype(np.int64)
