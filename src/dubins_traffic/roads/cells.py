"""The cells of a road table: what may be nearest to a point in each, and in finer ones what the road makes of it.

They only save time: whoever looks a point up (`roads.lookup`) gets the same answer whatever the cells are.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, sqrt
from typing import Final

import numpy as np

from dubins_traffic.kernels.arrays import INFINITE, Floats, Ints
from dubins_traffic.kernels.compile import jit, jit_inline
from dubins_traffic.kernels.records import table
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.roads.lookup import CELL, distance2, vertex_distance2
from dubins_traffic.roads.table import CellGrid, RoadTable

CELLS_PER_SEGMENT: Final = 8.0
PAVE_PER_SEGMENT: Final = 256.0
DIAGONAL: Final = sqrt(2.0)


class Sieve(Tables):
    """Scratch: of squares of cells within each other, smallest first, the one looked at, and its items.

    `column`, `row` (D + 1,): its place; `item` (D + 1, N), of which `filled` (D + 1,): what may be nearest somewhere in
    it, the last row all there is; `far` (N,): metres from its centre.
    """

    column: Ints
    row: Ints
    item: Ints
    filled: Ints
    far: Floats


def with_cells(rows: RoadTable, half_widths: Sequence[float]) -> RoadTable:
    """Return a table of networks with the widths of their roads, metres to either side, and with their cells."""
    t = rows.replace(half_width=np.array(half_widths, dtype=np.float64), grid=table(CellGrid, len(half_widths)))
    set_grids(t)
    columns, lines = t.grid["nx"], t.grid["ny"]
    count = max(int(np.diff(off).max()) for off in (t.seg_off, t.vert_off))
    depth = max(int(columns.max()), int(lines.max())).bit_length() + 2
    whole = np.zeros(depth, dtype=np.int64)
    work = Sieve(whole.copy(), whole.copy(), np.zeros((depth, count), dtype=np.int64), whole, np.zeros(count))
    spans = np.zeros((2, int(np.dot(columns, lines)), 2), dtype=np.int64)
    item = np.zeros(16 * spans.shape[1], dtype=np.int64)
    while (total := sieve(t, work, spans, item)) > len(item):
        item = np.zeros(total, dtype=np.int64)
    (seg_start, seg_item), (vert_start, vert_item) = (_in_order(item, *kind.T) for kind in spans)
    pave = np.full(int(np.dot(t.grid["pave_nx"], t.grid["pave_ny"])), CELL.OFF, dtype=np.int64)
    celled = t.replace(seg_start=seg_start, seg_item=seg_item, vert_start=vert_start, vert_item=vert_item, pave=pave)
    cover(celled)
    return celled


def _in_order(item: Ints, begin: Ints, count: Ints) -> tuple[Ints, Ints]:
    """Return (start, item): where the items of each cell begin, and the items of all cells, one after another."""
    start = np.concatenate([[0], np.cumsum(count)])
    return start, item[np.repeat(begin - start[:-1], count) + np.arange(start[-1])]


@jit
def set_grids(t: RoadTable) -> None:
    """Lay the cells of each network of a table `t`; those of `pave` where its roads have a width."""
    first = 0
    pave_first = 0
    for net in range(t.grid.shape[0]):
        grid = t.grid[net]
        roads = t.seg_off[net + 1] - t.seg_off[net]
        x0, y0, x1, y1 = INFINITE, INFINITE, -INFINITE, -INFINITE
        for v in range(t.vert_off[net], t.vert_off[net + 1]):
            at = t.vertex[v]
            x0, y0, x1, y1 = min(x0, at.x), min(y0, at.y), max(x1, at.x), max(y1, at.y)
        length = 0.0
        for s in range(t.seg_off[net], t.seg_off[net + 1]):
            segment = t.segment[s]
            length += segment.length
            for k in range(max(segment.piece, 0), segment.last + 1):
                end = t.piece[k]
                x0, y0, x1, y1 = min(x0, end.x), min(y0, end.y), max(x1, end.x), max(y1, end.y)
        margin = 0.5 * length / roads
        width, height = x1 - x0 + 2.0 * margin, y1 - y0 + 2.0 * margin
        side = sqrt(width * height / (CELLS_PER_SEGMENT * roads))
        grid.x0, grid.y0, grid.scale = x0 - margin, y0 - margin, 1.0 / side
        grid.nx, grid.ny = ceil(width / side), ceil(height / side)
        grid.first = first
        first += grid.nx * grid.ny
        half = t.half_width[net]
        grid.pave_first = pave_first
        if half > 0.0:
            side = max(0.35 * half, sqrt(width * height / (PAVE_PER_SEGMENT * roads)))
            grid.pave_scale = 1.0 / side
            grid.pave_nx, grid.pave_ny = ceil(width / side), ceil(height / side)
            pave_first += grid.pave_nx * grid.pave_ny


@jit_inline
def slack(grid: CellGrid) -> float:
    """Return what rounding may make up, m, for whoever looks a point up in the cells of a `grid` (row)."""
    side = 1.0 / grid.scale
    return 1e-9 * (side * (1 + grid.nx + grid.ny) + abs(grid.x0) + abs(grid.y0))


@jit
def sieve(t: RoadTable, scratch: Sieve, spans: Ints, item: Ints) -> int:
    """Find what may be nearest somewhere in each cell, segments and intersections, and return how many that are.

    Parameters
    ----------
    t : RoadTable
        The networks, with grids.
    scratch : Sieve
        Scratch.
    spans : (2, C, 2) int64
        Set, for each cell, to where its segments begin in `item`, and how many they are; then the same of
        intersections.
    item : (K,) int64
        Set to their numbers, those of a cell in ascending order; if it is too short, only as far as it goes.
    """
    total = 0
    for kind in range(2):
        for net in range(t.grid.shape[0]):
            grid = t.grid[net]
            top = 1
            while max(grid.nx, grid.ny) > 1 << (top - 1):
                top += 1
            off = t.vert_off if kind else t.seg_off
            scratch.filled[top] = off[net + 1] - off[net]
            for k in range(scratch.filled[top]):
                scratch.item[top, k] = k
            for level in range(top):
                scratch.column[level] = -1
            for code in range(1 << (2 * (top - 1))):
                column, row = 0, 0
                for bit in range(top - 1):
                    column |= (code >> (2 * bit) & 1) << bit
                    row |= (code >> (2 * bit + 1) & 1) << bit
                if column >= grid.nx or row >= grid.ny:
                    continue
                for level in range(top - 1, -1, -1):
                    if scratch.column[level] != column >> level or scratch.row[level] != row >> level:
                        scratch.column[level] = column >> level
                        scratch.row[level] = row >> level
                        _sift(t, net, kind == 1, level, scratch)
                number = grid.first + row * grid.nx + column
                spans[kind, number, 0] = total
                spans[kind, number, 1] = scratch.filled[0]
                for k in range(min(scratch.filled[0], item.shape[0] - total)):
                    item[total + k] = scratch.item[0, k]
                total += scratch.filled[0]
    return total


@jit
def _sift(t: RoadTable, net: int, vertices: bool, level: int, scratch: Sieve) -> None:
    """Keep, of the items of the square around it, what may be nearest somewhere in the square of a `level` (number).

    `vertices` (flag) instead of segments, of network `net` (number). Of half diagonal h and with least distance d from
    its centre, a square keeps the items at most d + 2h from the centre: no other is nearest to any of its points.
    """
    grid = t.grid[net]
    side = (1 << level) / grid.scale
    x = grid.x0 + (scratch.column[level] + 0.5) * side
    y = grid.y0 + (scratch.row[level] + 0.5) * side
    least = INFINITE
    for k in range(scratch.filled[level + 1]):
        n = scratch.item[level + 1, k]
        scratch.far[k] = sqrt(vertex_distance2(t, net, n, x, y) if vertices else distance2(t, net, n, x, y))
        least = min(least, scratch.far[k])
    most, filled = least + (DIAGONAL * side + slack(grid)), 0
    for k in range(scratch.filled[level + 1]):
        if scratch.far[k] <= most:
            scratch.item[level, filled] = scratch.item[level + 1, k]
            filled += 1
    scratch.filled[level] = filled


@jit
def cover(t: RoadTable) -> None:
    """Say of each cell of the `pave` of a table `t`, of which all are off the road, what the roads make of it."""
    for net in range(t.grid.shape[0]):
        grid, half = t.grid[net], t.half_width[net]
        if half <= 0.0:
            continue
        side = 1.0 / grid.pave_scale
        reach = 0.5 * DIAGONAL * side + half * 1e-9 + slack(grid)
        for row in range(t.seg_off[net], t.seg_off[net + 1]):
            segment = t.segment[row]
            for k in range(segment.piece, segment.last + 1):
                ax, ay, bx, by, pad = segment.x, segment.y, segment.end_x, segment.end_y, half + reach
                if k >= 0:
                    at = t.piece[k]
                    ax, ay, bx, by = at.x, at.y, at.end_x, at.end_y
                    chord2 = (bx - ax) * (bx - ax) + (by - ay) * (by - ay)
                    pad += at.radius - sqrt(max(at.radius * at.radius - 0.25 * chord2, 0.0))
                _cover_strip(t, net, row - t.seg_off[net], (ax, ay, bx, by), pad, reach)


@jit
def _cover_strip(
    t: RoadTable, net: int, s: int, line: tuple[float, float, float, float], pad: float, reach: float
) -> None:
    """Say what the road of segment `s` (segment) of network `net` makes of the cells within `pad` (m) of a line of it.

    `line` (m) is where it begins and ends, `reach` (m) how far the corners of a cell are from its centre, rounding
    included.
    """
    grid, half = t.grid[net], t.half_width[net]
    side = 1.0 / grid.pave_scale
    ax, ay, bx, by = line
    if ax > bx:
        ax, ay, bx, by = bx, by, ax, ay
    slope = (by - ay) / (bx - ax) if bx > ax else 0.0
    first = max(int((ax - pad - grid.x0) / side), 0)
    last = min(int((bx + pad - grid.x0) / side), grid.pave_nx - 1)
    for column in range(first, last + 1):
        x = grid.x0 + (column + 0.5) * side
        low = ay + slope * (min(max(x - pad, ax), bx) - ax)
        high = ay + slope * (min(max(x + pad, ax), bx) - ax) if bx > ax else by
        bottom = max(int((min(low, high) - pad - grid.y0) / side), 0)
        top = min(int((max(low, high) + pad - grid.y0) / side), grid.pave_ny - 1)
        for row in range(bottom, top + 1):
            away = sqrt(distance2(t, net, s, x, grid.y0 + (row + 0.5) * side))
            number = grid.pave_first + row * grid.pave_nx + column
            if away <= half - reach:
                t.pave[number] = CELL.ON
            elif away <= half + reach and t.pave[number] != CELL.ON and t.pave[number] != s:
                t.pave[number] = s if t.pave[number] == CELL.OFF else CELL.MIXED
