"""Road networks as arrays for kernels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
import numpy.typing as npt

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.roads.road_raster import road_raster


class RoadTable(Tables):
    """K networks, one after another; segments, intersections and lanes are numbered within their network.

    Attributes
    ----------
    half_width : array (K,)
        Half the width of the roads, 2w, metres.
    seg_off : array (K + 1,)
        First row of each network in `seg` and `ends`.
    seg : array (S, 7)
        First end ax, ay; unit tangent tx, ty; length; second end bx, by.
    ends : array (S, 2)
        Intersections at the ends.
    vert_off : array (K + 1,)
        First row of each network in `vert`, `arms` and `degree`.
    vert : array (V, 2)
        Intersections, metres.
    arms : array (V, 4)
        Lanes out of an intersection, counter-clockwise, then -1.
    degree : array (V,)
        Number of roads at an intersection.
    cell_box : array (K, 3)
        Lower corner x0, y0 of the box of cells, and 1 / side of a cell.
    cell_dim : array (K, 3)
        Columns and rows of cells, and the number of the first cell; cell (cx, cy) is number first + cy * nx + cx.
    seg_start, vert_start : arrays (C + 1,)
        Where the candidates of each cell begin in `seg_item`, `vert_item`.
    seg_item, vert_item : arrays
        What may be nearest to a point of the cell, in ascending order.
    pave_scale : array (K,)
        1 / side of a cell of `pave`; these finer cells begin at x0, y0 too.
    pave_dim : array (K, 3)
        Columns and rows of the cells of `pave`, and the number of the first.
    pave : array
        What the road makes of a cell, see `roads.road_raster`.
    """

    half_width: Floats
    seg_off: Ints
    seg: Floats
    ends: Ints
    vert_off: Ints
    vert: Floats
    arms: Ints
    degree: Ints
    cell_box: Floats
    cell_dim: Ints
    seg_start: Ints
    seg_item: Ints
    vert_start: Ints
    vert_item: Ints
    pave_scale: Floats
    pave_dim: Ints
    pave: Ints


def pack_distinct(networks: Sequence[RoadNetwork], half_widths: Sequence[float]) -> tuple[RoadTable, Ints]:
    """Return the table of the distinct pairs of network and half width, and the number of each trial's pair in it."""
    numbers: dict[tuple[int, float], int] = {}
    for network, width in zip(networks, half_widths, strict=True):
        numbers.setdefault((id(network), width), len(numbers))
    given = [numbers[id(network), width] for network, width in zip(networks, half_widths, strict=True)]
    first = [given.index(number) for number in range(len(numbers))]
    table = pack([networks[k] for k in first], [half_widths[k] for k in first])
    return table, np.array(given, dtype=np.int64)


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
    joined = RoadTable(*(np.concatenate(columns) for columns in zip(*tables, strict=True)))
    return joined.replace(
        seg_off=_offsets([len(table.seg) for table in tables]),
        vert_off=_offsets([len(table.vert) for table in tables]),
        cell_dim=_dimensions(joined.cell_dim),
        seg_start=_starts([table.seg_start for table in tables]),
        vert_start=_starts([table.vert_start for table in tables]),
        pave_dim=_dimensions(joined.pave_dim),
    )


def _table(network: RoadNetwork, half_width: float) -> RoadTable:
    """Return the table of one network (kept for next time, never to be written to)."""
    key = RoadTable, half_width
    if key not in network.known:
        raster, cells = road_raster(network.surface, half_width), network.surface.cells
        network.known[key] = RoadTable(
            half_width=np.array([half_width], dtype=np.float64),
            seg_off=_offsets([len(network.segments)]),
            seg=_segments(network),
            ends=network.ends.copy(),
            vert_off=_offsets([len(network.points)]),
            vert=network.points.copy(),
            arms=_arms(network),
            degree=network.degrees.copy(),
            cell_box=np.array([[cells.x0, cells.y0, cells.scale]], dtype=np.float64),
            cell_dim=np.array([[cells.nx, cells.ny, 0]], dtype=np.int64),
            seg_start=cells.seg_start,
            seg_item=cells.seg_item,
            vert_start=cells.vert_start,
            vert_item=cells.vert_item,
            pave_scale=np.array([raster.scale], dtype=np.float64),
            pave_dim=np.array([[raster.nx, raster.ny, 0]], dtype=np.int64),
            pave=raster.pave,
        )
    return cast(RoadTable, network.known[key])


def _segments(network: RoadNetwork) -> Floats:
    first, second = network.points[network.ends[:, 0]], network.points[network.ends[:, 1]]
    return np.concatenate([first, network.tangents, network.lengths[:, None], second], axis=1)


def _arms(network: RoadNetwork) -> Ints:
    rows = np.full((len(network.points), 4), -1, dtype=np.int64)
    for v in range(len(network.points)):
        out = network.arms(v)
        rows[v, : len(out)] = out
    return rows


def _offsets(counts: Sequence[int] | Ints) -> Ints:
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)


def _dimensions(sizes: Ints) -> Ints:
    """Return columns and rows of cells with the number of the first."""
    return np.concatenate([sizes[:, :2], _offsets(sizes[:, 0] * sizes[:, 1])[:-1, None]], axis=1)


def _starts(starts: Sequence[npt.NDArray[np.int64]]) -> Ints:
    shift = _offsets([int(start[-1]) for start in starts])
    rows = [start[:-1] + shift[k] for k, start in enumerate(starts)]
    return np.concatenate([*rows, shift[-1:]]).astype(np.int64)
