"""Road networks as arrays for kernels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.roads.paving import pave


class RoadTable(NamedTuple):
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
        What the road makes of a cell, see `roads.paving`.
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
    paving = [pave(network.surface, width) for network, width in zip(networks, half_widths, strict=True)]
    cells = [network.surface.cells for network in networks]
    return RoadTable(
        half_width=np.array(half_widths, dtype=np.float64),
        seg_off=_offsets([len(network.segments) for network in networks]),
        seg=np.concatenate([_segments(network) for network in networks]),
        ends=np.concatenate([network.ends for network in networks]),
        vert_off=_offsets([len(network.points) for network in networks]),
        vert=np.concatenate([network.points for network in networks]),
        arms=np.concatenate([_arms(network) for network in networks]),
        degree=np.concatenate([network.degrees for network in networks]),
        cell_box=np.array([[own.x0, own.y0, own.scale] for own in cells], dtype=np.float64),
        cell_dim=_dimensions([(own.nx, own.ny) for own in cells]),
        seg_start=_starts([own.seg_start for own in cells]),
        seg_item=np.concatenate([own.seg_item for own in cells]),
        vert_start=_starts([own.vert_start for own in cells]),
        vert_item=np.concatenate([own.vert_item for own in cells]),
        pave_scale=np.array([own.scale for own in paving], dtype=np.float64),
        pave_dim=_dimensions([(own.nx, own.ny) for own in paving]),
        pave=np.concatenate([own.pave for own in paving]),
    )


def _segments(network: RoadNetwork) -> Floats:
    first, second = network.points[network.ends[:, 0]], network.points[network.ends[:, 1]]
    return np.concatenate([first, network.tangents, network.lengths[:, None], second], axis=1)


def _arms(network: RoadNetwork) -> Ints:
    rows = np.full((len(network.points), 4), -1, dtype=np.int64)
    for v in range(len(network.points)):
        out = network.arms(v)
        rows[v, : len(out)] = out
    return rows


def _offsets(counts: Sequence[int]) -> Ints:
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)


def _dimensions(sizes: Sequence[tuple[int, int]]) -> Ints:
    size = np.array(sizes, dtype=np.int64)
    first = _offsets([nx * ny for nx, ny in sizes])[:-1]
    return np.concatenate([size, first[:, None]], axis=1)


def _starts(starts: Sequence[npt.NDArray[np.int64]]) -> Ints:
    shift = _offsets([int(start[-1]) for start in starts])
    rows = [start[:-1] + shift[k] for k, start in enumerate(starts)]
    return np.concatenate([*rows, shift[-1:]]).astype(np.int64)
