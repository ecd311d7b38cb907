"""Where points lie on a network, in NumPy: nearest segment and intersection, on the road or not, lane coordinates.

The box around a network is cut into uniform cells; each keeps what may be nearest to a point in it, so that
looking a point up costs the same on a network of any size.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from math import ceil, sqrt
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np
import numpy.typing as npt

from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.roads.chains import Bars, Chains

CELLS_PER_SEGMENT = 8.0
POINTS_AT_ONCE = 1 << 15
FEW = 1 << 14
"""Up to so many pairs of a cell and an item all are looked at, which is sooner done."""

if TYPE_CHECKING:
    from dubins_traffic.roads.cells import RoadRaster

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
