"""The cells of a road table: what may be nearest to a point in each, and in finer ones what the road makes of it.

They only save time: whoever looks a point up (`roads.lookup`) gets the same answer whatever the cells are.
"""

from __future__ import annotations

from math import ceil, sqrt
from typing import Final

import numpy as np

from dubins_traffic.kernels.arrays import INFINITE, Floats, Ints
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.records import join
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.roads.lookup import CELL, distance2, vertex_distance2
from dubins_traffic.roads.table import RoadTable

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


def with_cells(t: RoadTable) -> RoadTable:
    """Return the table of one network with its cells."""
    places = [np.concatenate([t.vertex[z], t.piece[z], t.piece[f"end_{z}"]]) for z in ("x", "y")]
    margin = 0.5 * float(t.segment["length"].mean())
    (x0, y0), (x1, y1) = ([float(pick(z)) for z in places] for pick in (np.min, np.max))
    width, height = x1 - x0 + 2.0 * margin, y1 - y0 + 2.0 * margin
    side = sqrt(width * height / (CELLS_PER_SEGMENT * len(t.segment)))
    own = t.grid[0]
    own.x0, own.y0, own.scale = x0 - margin, y0 - margin, 1.0 / side
    own.nx, own.ny = ceil(width / side), ceil(height / side)
    slack = 1e-9 * (side + abs(x0) + abs(y0) + width + height)
    count, depth = max(len(t.segment), len(t.vertex)), max(own.nx - 1, own.ny - 1).bit_length() + 2
    whole = np.zeros(depth, dtype=np.int64)
    work = Sieve(whole.copy(), whole.copy(), np.zeros((depth, count), dtype=np.int64), whole, np.zeros(count))
    spans = np.zeros((2, own.nx * own.ny, 2), dtype=np.int64)
    item = np.zeros(16 * own.nx * own.ny, dtype=np.int64)
    while (total := sieve(t, np.array([side, slack]), work, spans, item)) > len(item):
        item = np.zeros(total, dtype=np.int64)
    (seg_start, seg_item), (vert_start, vert_item) = (_in_order(item, *kind.T) for kind in spans)
    return t.replace(seg_start=seg_start, seg_item=seg_item, vert_start=vert_start, vert_item=vert_item)


def _in_order(item: Ints, begin: Ints, count: Ints) -> tuple[Ints, Ints]:
    """Return (start, item): where the items of each cell begin, and the items of all cells, one after another."""
    start = np.concatenate([[0], np.cumsum(count)])
    return start, item[np.repeat(begin - start[:-1], count) + np.arange(start[-1])]


@jit
def sieve(t: RoadTable, metres: Floats, own: Sieve, spans: Ints, item: Ints) -> int:
    """Find what may be nearest somewhere in each cell, segments and intersections, and return how many that are.

    Parameters
    ----------
    t : RoadTable
        The table of one network.
    metres : (2,) float64
        The side of a cell, and what rounding may make up, m.
    own : Sieve
        Scratch.
    spans : (2, C, 2) int64
        Set, for each cell, to where its segments begin in `item`, and how many they are; then the same of
        intersections.
    item : (K,) int64
        Set to their numbers, those of a cell in ascending order; if it is too short, only as far as it goes.
    """
    grid = t.grid[0]
    top = own.filled.shape[0] - 1
    total = 0
    for kind in range(2):
        own.filled[top] = t.vert_off[1] if kind else t.seg_off[1]
        for k in range(own.filled[top]):
            own.item[top, k] = k
        for level in range(top):
            own.column[level] = -1
        for code in range(1 << (2 * (top - 1))):
            column, row = 0, 0
            for bit in range(top - 1):
                column |= (code >> (2 * bit) & 1) << bit
                row |= (code >> (2 * bit + 1) & 1) << bit
            if column >= grid.nx or row >= grid.ny:
                continue
            for level in range(top - 1, -1, -1):
                if own.column[level] != column >> level or own.row[level] != row >> level:
                    own.column[level] = column >> level
                    own.row[level] = row >> level
                    _sift(t, kind == 1, level, metres, own)
            number = row * grid.nx + column
            spans[kind, number, 0] = total
            spans[kind, number, 1] = own.filled[0]
            for k in range(min(own.filled[0], item.shape[0] - total)):
                item[total + k] = own.item[0, k]
            total += own.filled[0]
    return total


@jit
def _sift(t: RoadTable, vertices: bool, level: int, metres: Floats, own: Sieve) -> None:
    """Keep, of the items of the square around it, what may be nearest somewhere in the square of a `level` (number).

    `vertices` (flag), `metres` (m) as for `sieve`. Of half diagonal h and with least distance d from its centre, a
    square keeps the items at most d + 2h from the centre: no other is nearest to any of its points.
    """
    side = metres[0] * (1 << level)
    x = t.grid[0].x0 + (own.column[level] + 0.5) * side
    y = t.grid[0].y0 + (own.row[level] + 0.5) * side
    least = INFINITE
    for k in range(own.filled[level + 1]):
        n = own.item[level + 1, k]
        own.far[k] = sqrt(vertex_distance2(t, 0, n, x, y) if vertices else distance2(t, 0, n, x, y))
        least = min(least, own.far[k])
    filled = 0
    for k in range(own.filled[level + 1]):
        if own.far[k] <= least + (DIAGONAL * side + metres[1]):
            own.item[level, filled] = own.item[level + 1, k]
            filled += 1
    own.filled[level] = filled


def with_pave(t: RoadTable, half_width: float) -> RoadTable:
    """Return the table of one network, which has cells, with what roads `half_width` metres to either side cover."""
    grid = join([t.grid])
    own = grid[0]
    width, height = own.nx / own.scale, own.ny / own.scale
    side = max(0.35 * half_width, sqrt(width * height / (PAVE_PER_SEGMENT * len(t.segment))))
    own.pave_scale, own.pave_nx, own.pave_ny = 1.0 / side, ceil(width / side), ceil(height / side)
    slack = 1e-9 * (side + half_width + abs(own.x0) + abs(own.y0) + width + height)
    pave = np.full(own.pave_nx * own.pave_ny, CELL.OFF, dtype=np.int64)
    found = t.replace(half_width=np.array([half_width], dtype=np.float64), grid=grid, pave=pave)
    cover(found, side, sqrt(0.5) * side + slack)
    return found


@jit
def cover(t: RoadTable, side: float, reach: float) -> None:
    """Say of each cell of a table's `pave`, of which all are off the road, what the roads make of it.

    Parameters
    ----------
    t : RoadTable
        The table of one network.
    side : float
        That of a cell, m.
    reach : float
        From its centre to a corner, and what rounding may make up, m.
    """
    grid, half = t.grid[0], t.half_width[0]
    for s in range(t.seg_off[1]):
        own = t.segment[s]
        for k in range(own.piece, own.last + 1):
            ax, ay, bx, by, pad = own.x, own.y, own.end_x, own.end_y, half + reach
            if k >= 0:
                at = t.piece[k]
                ax, ay, bx, by = at.x, at.y, at.end_x, at.end_y
                chord2 = (bx - ax) * (bx - ax) + (by - ay) * (by - ay)
                pad += at.radius - sqrt(max(at.radius * at.radius - 0.25 * chord2, 0.0))
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
                    _cover_cell(t, s, column, row, side, reach)


@jit
def _cover_cell(t: RoadTable, s: int, column: int, row: int, side: float, reach: float) -> None:
    """Say what the road of segment `s` (segment) makes of a cell; `side` and `reach` (m) as for `cover`."""
    grid, half = t.grid[0], t.half_width[0]
    x, y = grid.x0 + (column + 0.5) * side, grid.y0 + (row + 0.5) * side
    away = sqrt(distance2(t, 0, s, x, y))
    number = row * grid.pave_nx + column
    if away <= half - reach:
        t.pave[number] = CELL.ON
    elif away <= half + reach and t.pave[number] != CELL.ON and t.pave[number] != s:
        t.pave[number] = s if t.pave[number] == CELL.OFF else CELL.MIXED
