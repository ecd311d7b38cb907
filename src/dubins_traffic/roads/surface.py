"""Where points lie on a network, in NumPy: nearest segment and intersection, on the road or not, lane coordinates.

The box around a network is cut into uniform cells; each keeps what may be nearest to a point in it, so that
looking a point up costs the same on a network of any size. Finer ones, a `RoadRaster`, say at a glance whether a point
lies on the road.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property
from math import ceil, sqrt
from typing import TYPE_CHECKING, Final, NamedTuple, cast

import numpy as np
import numpy.typing as npt

from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.roads.chains import Bars, Chains

CELLS_PER_SEGMENT = 8.0
POINTS_AT_ONCE = 1 << 15
FEW = 1 << 14
"""Up to so many pairs of a cell and an item all are looked at, which is sooner done."""
PAIRS_AT_ONCE = 1 << 21
RASTER_CELLS_PER_SEGMENT: Final = 256.0
SAGITTA: Final = 0.1
"""How far the bars that stand for an arc may leave it, in half widths of the road."""


if TYPE_CHECKING:
    from dubins_traffic.roads.surface import RoadRaster

Distance2 = Callable[[Floats, Floats, Ints], Floats]


class Cells(NamedTuple):
    """Uniform cells over a box: cell (cx, cy) has the number cy * nx + cx.

    What may be nearest to a point of cell c stands, in ascending order, in ``seg_item`` (segments) and
    ``vert_item`` (intersections) from ``start[c]`` up to ``start[c + 1]``.
    """

    x0: float
    y0: float
    scale: float
    nx: int
    ny: int
    seg_start: Ints
    seg_item: Ints
    vert_start: Ints
    vert_item: Ints


class Surface:
    """The segments and intersections of a network in the world.

    Parameters
    ----------
    points : array (V, 2)
        Intersections, metres.
    ends : array (S, 2)
        Numbers of the intersections at the ends of each segment.
    tangents : array (S, 2)
        Unit vectors along the segments.
    lengths : array (S,)
        Lengths of the segments, metres.
    chains : Chains or None
        Those of the segments that bend.
    """

    def __init__(
        self, points: Floats, ends: Ints, tangents: Floats, lengths: Floats, chains: Chains | None = None
    ) -> None:
        self.points = points
        self.start = points[ends[:, 0]]
        self.end = points[ends[:, 1]]
        self.tangents = tangents
        self.lengths = lengths
        self.chains = chains
        self.rasters: dict[float, RoadRaster] = {}

    def nearest_segment(self, points: npt.ArrayLike) -> tuple[Ints, Floats]:
        """Return the number of the nearest segment and the distance, for points (..., 2)."""
        cells = self.cells
        return self._nearest(points, self.distance2, len(self.start), cells.seg_start, cells.seg_item)

    def nearest_vertex(self, points: npt.ArrayLike) -> tuple[Ints, Floats]:
        """Return the number of the nearest intersection and the distance, for points (..., 2)."""
        cells = self.cells
        count = len(self.points)
        return self._nearest(points, self.vertex_distance2, count, cells.vert_start, cells.vert_item)

    def on_road(self, points: npt.ArrayLike, half_width: float) -> npt.NDArray[np.bool_]:
        """Whether points (..., 2) lie within `half_width` of a segment, its ends capped by discs."""
        points = np.asarray(points, dtype=np.float64)
        s, _ = self.nearest_segment(points)
        return self.distance2(points[..., 0], points[..., 1], s) <= half_width * half_width

    def lane_coordinates(self, lane: int, points: npt.ArrayLike) -> tuple[Floats, Floats]:
        """Return (s, l): metres along a lane from its start, metres left of the segment's centre line."""
        points = np.asarray(points, dtype=np.float64)
        s = lane >> 1
        rx, ry = points[..., 0] - self.start[s, 0], points[..., 1] - self.start[s, 1]
        tx, ty = self.tangents[s, 0], self.tangents[s, 1]
        along, left = rx * tx + ry * ty, tx * ry - ty * rx
        if self.chains is not None and self.chains.bends(s):
            flat = points.reshape(-1, 2)
            found = self.chains.coordinates(flat[:, 0], flat[:, 1], np.full(len(flat), s), bool(lane & 1))
            along, left = (each.reshape(points.shape[:-1]) for each in found)
            return along, left
        return (self.lengths[s] - along, -left) if lane & 1 else (along, left)

    @cached_property
    def cells(self) -> Cells:
        """The cells, made when first asked for."""
        corners = self.points if self.chains is None else np.concatenate([self.points, self.bars(1.0).start])
        low, high = corners.min(axis=0), corners.max(axis=0)
        margin = 0.5 * float(self.lengths.mean())
        x0, y0 = (low - margin).tolist()
        width, height = (high - low + 2.0 * margin).tolist()
        size = sqrt(width * height / (CELLS_PER_SEGMENT * len(self.lengths)))
        nx, ny = ceil(width / size), ceil(height / size)
        slack = 1e-9 * (size + abs(x0) + abs(y0) + width + height)
        box = (x0, y0, size, nx, ny, slack)
        seg = _sieve(box, self.distance2, len(self.lengths))
        vert = _sieve(box, self.vertex_distance2, len(self.points))
        return Cells(x0, y0, 1.0 / size, nx, ny, *seg, *vert)

    def distance2(self, x: Floats, y: Floats, s: Ints) -> Floats:
        """Return the squared distances from points (x, y) to segments s; the three are broadcast."""
        straight = self._straight_distance2(x, y, s)
        if self.chains is None:
            return straight
        x, y, s = np.broadcast_arrays(x, y, s)
        bent = self.chains.bends(s)
        found = np.array(straight)
        found[bent] = self.chains.distance2(x[bent], y[bent], s[bent])
        return found

    def bars(self, sagitta: float) -> Bars:
        """Return straight bars that stand for the segments: chains leave them by at most `sagitta` metres."""
        if self.chains is None:
            return Bars(np.arange(len(self.start)), self.start, self.end)
        return self.chains.bars(self.start, self.end, sagitta)

    def _straight_distance2(self, x: Floats, y: Floats, s: Ints) -> Floats:
        rx, ry = x - self.start[s, 0], y - self.start[s, 1]
        qx, qy = x - self.end[s, 0], y - self.end[s, 1]
        tx, ty = self.tangents[s, 0], self.tangents[s, 1]
        along, across = rx * tx + ry * ty, tx * ry - ty * rx
        beyond = cast(Floats, np.where(along >= self.lengths[s], qx * qx + qy * qy, across * across))
        return np.where(along <= 0.0, rx * rx + ry * ry, beyond)

    def vertex_distance2(self, x: Floats, y: Floats, v: Ints) -> Floats:
        """Return the squared distances from points (x, y) to intersections v; the three are broadcast."""
        rx, ry = x - self.points[v, 0], y - self.points[v, 1]
        return rx * rx + ry * ry

    def _nearest(
        self, points: npt.ArrayLike, distance2: Distance2, count: int, start: Ints, item: Ints
    ) -> tuple[Ints, Floats]:
        points = np.asarray(points, dtype=np.float64)
        flat = points.reshape(-1, 2)
        index = np.empty(len(flat), dtype=np.int64)
        square = np.empty(len(flat), dtype=np.float64)
        everything = np.arange(count)
        for begin in range(0, len(flat), POINTS_AT_ONCE):
            block = slice(begin, begin + POINTS_AT_ONCE)
            x, y = flat[block, 0], flat[block, 1]
            cell = self._cell(x, y)
            inside = cell >= 0
            near = _first_least(x[inside], y[inside], cell[inside], distance2, start, item)
            index[block][inside], square[block][inside] = near
            for k in np.flatnonzero(~inside) + begin:
                away = distance2(flat[k, 0], flat[k, 1], everything)
                index[k] = np.argmin(away)
                square[k] = away[index[k]]
        return index.reshape(points.shape[:-1]), np.sqrt(square).reshape(points.shape[:-1])

    def _cell(self, x: Floats, y: Floats) -> Ints:
        """Return the numbers of the cells of points, -1 outside the box."""
        cells = self.cells
        u, v = (x - cells.x0) * cells.scale, (y - cells.y0) * cells.scale
        inside = (u >= 0.0) & (u < cells.nx) & (v >= 0.0) & (v < cells.ny)
        cx = np.where(inside, u, 0.0).astype(np.int64)
        cy = np.where(inside, v, 0.0).astype(np.int64)
        return np.where(inside, cy * cells.nx + cx, -1)


def _first_least(
    x: Floats, y: Floats, cell: Ints, distance2: Distance2, start: Ints, item: Ints
) -> tuple[Ints, Floats]:
    """Return, for each point, the first of its cell's items that has the least squared distance, and that."""
    if not len(x):
        return np.empty(0, dtype=np.int64), np.empty(0)
    count = start[cell + 1] - start[cell]
    begin = np.cumsum(count) - count
    group = np.repeat(np.arange(len(x)), count)
    candidate = item[start[cell][group] + np.arange(len(group)) - begin[group]]
    square = distance2(x[group], y[group], candidate)
    least = np.minimum.reduceat(square, begin)
    equal = np.flatnonzero(square == least[group])
    _, first = np.unique(group[equal], return_index=True)
    return candidate[equal[first]], least


def _sieve(
    box: tuple[float, float, float, int, int, float], distance2: Distance2, count: int
) -> tuple[Ints, Ints]:
    """Return (start, item): the items that may be nearest somewhere in each cell.

    One cell that covers the box is halved again and again, or all cells are looked at where they are few. Of half
    diagonal h and with least distance d from its centre, a cell keeps the items at most d + 2h from the centre: no
    other is nearest to any of its points.
    """
    x0, y0, size, nx, ny, slack = box
    few = nx * ny * count <= FEW
    depth = 0 if few else (max(nx, ny) - 1).bit_length()
    cy, cx = np.divmod(np.arange(nx * ny if few else 1), nx)
    item = np.tile(np.arange(count), len(cx))
    start = count * np.arange(len(cx) + 1)
    for level in range(depth, -1, -1):
        side = size * (1 << level)
        group = np.repeat(np.arange(len(cx)), np.diff(start))
        middle_x, middle_y = x0 + (cx + 0.5) * side, y0 + (cy + 0.5) * side
        distance = np.sqrt(distance2(middle_x[group], middle_y[group], item))
        least = np.minimum.reduceat(distance, start[:-1])
        keep = distance <= least[group] + (sqrt(2.0) * side + slack)
        item, group = item[keep], group[keep]
        start = np.searchsorted(group, np.arange(len(cx) + 1))
        if level:
            last = ((nx - 1) >> (level - 1), (ny - 1) >> (level - 1))
            cx, cy, start, item = _halve(cx, cy, start, item, last)
    number = cy * nx + cx
    order = np.argsort(number)
    return _gather(start, item, order)


def _halve(
    cx: Ints, cy: Ints, start: Ints, item: Ints, last: tuple[int, int]
) -> tuple[Ints, Ints, Ints, Ints]:
    """Return the quarters of cells, with their items, that begin at most at the cell `last`."""
    parent = np.repeat(np.arange(len(cx)), 4)
    quarter = np.tile(np.arange(4), len(cx))
    x, y = 2 * cx[parent] + (quarter & 1), 2 * cy[parent] + (quarter >> 1)
    keep = (x <= last[0]) & (y <= last[1])
    return x[keep], y[keep], *_gather(start, item, parent[keep])


def _gather(start: Ints, item: Ints, order: Ints) -> tuple[Ints, Ints]:
    """Return the groups of `item` that `start` delimits, in another order."""
    count = np.diff(start)[order]
    new = np.concatenate([[0], np.cumsum(count)])
    place = cast(Ints, np.repeat(start[:-1][order] - new[:-1], count) + np.arange(new[-1]))
    return new, item[place]


class RoadRaster(NamedTuple):
    """Cells over the box of `Surface.cells`: cell (cx, cy) has the number cy * nx + cx.

    ``pave`` holds the number of the only segment whose road meets the cell, or a `road_raster.CELL`.
    """

    scale: float
    nx: int
    ny: int
    pave: Ints


def covered(start: Floats, end: Floats, pad: float, size: float) -> tuple[Ints, Ints, Ints]:
    """Return the cells that segments touch when grown by `pad`: a superset, as rows (item, column, row).

    Parameters
    ----------
    start, end : array (S, 2)
        Ends of the segments.
    pad : float
        Distance by which they are grown.
    size : float
        Side of a cell; cell (0, 0) begins in the origin.
    """
    rounding = 1e-9 * (size + float(np.abs(start).max(initial=0.0)))
    pad += rounding
    swap = start[:, 0] > end[:, 0]
    low = np.where(swap[:, None], end, start)
    high = np.where(swap[:, None], start, end)
    first = np.floor((low[:, 0] - pad) / size).astype(np.int64)
    last = np.floor((high[:, 0] + pad) / size).astype(np.int64)
    item, column = _spread(first, last)
    run = high[item, 0] - low[item, 0]
    upright = run <= rounding
    slope = np.divide(high[item, 1] - low[item, 1], run, out=np.zeros_like(run), where=~upright)
    left = np.clip(column * size - pad - low[item, 0], 0.0, run)
    right = np.clip((column + 1) * size + pad - low[item, 0], 0.0, run)
    y0 = low[item, 1] + slope * left
    y1 = cast(Floats, np.where(upright, high[item, 1], low[item, 1] + slope * right))
    bottom = np.floor((np.minimum(y0, y1) - pad) / size).astype(np.int64)
    top = np.floor((np.maximum(y0, y1) + pad) / size).astype(np.int64)
    strip, row = _spread(bottom, top)
    return item[strip], column[strip], row


def pairs(item: Ints, column: Ints, row: Ints) -> Iterator[tuple[Ints, Ints]]:
    """Yield the pairs of items that share a cell, in blocks; a pair may come more than once."""
    height = int(row.max(initial=0)) - int(row.min(initial=0)) + 1
    key = (column - column.min(initial=0)) * height + row
    order = np.lexsort((item, key))
    key, item = key[order], item[order]
    count = len(key)
    after = cast(Ints, np.searchsorted(key, key, side="right") - np.arange(count) - 1)
    total = cast(Ints, np.concatenate([[0], np.cumsum(after)]))
    begin = 0
    while begin < count:
        full = int(total[begin]) + PAIRS_AT_ONCE
        stop = int(np.searchsorted(total, full, side="right")) - 1
        stop = min(max(stop, begin + 1), count)
        near = np.repeat(np.arange(begin, stop), after[begin:stop])
        step = np.arange(len(near)) - np.repeat(total[begin:stop] - total[begin], after[begin:stop])
        yield item[near], item[near + 1 + step]
        begin = stop


def _spread(first: Ints, last: Ints) -> tuple[Ints, Ints]:
    """Return (k, value) for every k and every value in first[k]..last[k]."""
    count = last - first + 1
    k = np.repeat(np.arange(len(first)), count)
    begin = np.repeat(np.cumsum(count) - count, count)
    return k, first[k] + np.arange(len(k)) - begin


class _Cell(NamedTuple):
    """What stands in a cell of `RoadRaster.pave` in place of the number of a segment."""

    OFF: int = -1
    """No point of it is on the road."""
    ON: int = -2
    """All are."""
    MIXED: int = -3
    """The roads of several segments meet it."""


CELL: Final = _Cell()


def road_raster(surface: Surface, half_width: float) -> RoadRaster:
    """Return the raster of roads `half_width` metres to either side of the segments (kept for next time)."""
    kept = surface.rasters.get(half_width)
    if kept is None:
        kept = surface.rasters[half_width] = _drawn(surface, half_width)
    return kept


def _drawn(surface: Surface, half_width: float) -> RoadRaster:
    cells = surface.cells
    width, height = cells.nx / cells.scale, cells.ny / cells.scale
    finest = sqrt(width * height / (RASTER_CELLS_PER_SEGMENT * len(surface.lengths)))
    side = max(0.35 * half_width, finest)
    nx, ny = ceil(width / side), ceil(height / side)
    slack = 1e-9 * (side + half_width + abs(cells.x0) + abs(cells.y0) + width + height)
    origin = np.array([cells.x0, cells.y0])
    owner, start, end = surface.bars(slack + SAGITTA * half_width)
    spread = 0.0 if surface.chains is None else SAGITTA * half_width
    item, cx, cy = covered(start - origin, end - origin, half_width + slack + spread, side)
    keep = (cx >= 0) & (cx < nx) & (cy >= 0) & (cy < ny)
    item, cx, cy = owner[item[keep]], cx[keep], cy[keep]
    if surface.chains is not None:
        number = np.unique((item * ny + cy) * nx + cx)
        item, cy, cx = number // (ny * nx), number // nx % ny, number % nx
    x = cast(Floats, cells.x0 + (cx + 0.5) * side)
    y = cast(Floats, cells.y0 + (cy + 0.5) * side)
    distance: Floats = np.sqrt(surface.distance2(x, y, item))
    reach = sqrt(0.5) * side + slack
    keep = distance <= half_width + reach
    number, item = (cy * nx + cx)[keep], item[keep]
    paved = np.full(nx * ny, CELL.OFF, dtype=np.int64)
    paved[number] = item
    paved[np.bincount(number, minlength=nx * ny) > 1] = CELL.MIXED
    paved[number[distance[keep] <= half_width - reach]] = CELL.ON
    return RoadRaster(1.0 / side, nx, ny, paved)
