"""Free places for cars on the right lanes of a network: intervals of lanes' centre lines, without what blocks them.

Places are found exactly, not by trial and error, so that "does not fit" is a fact. All bits follow from
+ - * / and square roots in a fixed order.
"""

from __future__ import annotations

from collections.abc import Collection
from math import ceil, floor
from typing import NamedTuple

import numpy as np

from dubins_traffic.cars.state import Pose
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.problem.lane_lines import Lines, band, chord
from dubins_traffic.problem.overlap import Point, Shape, contains, edges
from dubins_traffic.roads.cells import covered, pairs
from dubins_traffic.roads.network import RoadNetwork

SLACK = 1e-9
"""Added to every clearance, metres, so that rounding never makes it too small."""


class Intervals(NamedTuple):
    """Intervals of lanes, ascending by lane, then place: arrays (K,) of lane, and of metres along it."""

    lane: Ints
    low: Floats
    high: Floats

    def select(self, index: Ints) -> Intervals:
        """Return the intervals with the numbers `index`."""
        return Intervals(self.lane[index], self.low[index], self.high[index])


class Places:
    """Intervals of right lanes' centre lines in which the centre of a car may stand, those of straight runs only.

    Parameters
    ----------
    network : RoadNetwork
        The roads.
    w : float
        The right lane's centre line is this far right of the segment's, metres.
    """

    def __init__(self, network: RoadNetwork, w: float) -> None:
        self._lines = Lines.right(network, w)
        self._near = _Near(network, w)
        self._network = network
        lane = np.arange(network.lanes)
        self._free = Intervals(lane, np.zeros(len(lane)), np.repeat(network.runs.length, 2))

    @property
    def count(self) -> int:
        """Number of lanes of the network."""
        return self._network.lanes

    def copy(self) -> Places:
        """Return an independent copy."""
        twin = object.__new__(Places)
        twin.__dict__.update(self.__dict__)
        return twin

    def block(self, x: float, y: float, radius: float) -> None:
        """Remove all places closer than `radius` to (x, y)."""
        radius += SLACK
        index = self._around(x, y, radius)
        own = self._free.select(index)
        along, left = self._lines.relative(own.lane, x, y)
        self._put(index, _cut(own, *chord(along, left, radius)))

    def block_shape(self, shape: Shape, clearance: float) -> None:
        """Remove all places closer than `clearance` to a shape, or inside it."""
        radius = shape.rounding + clearance + SLACK
        x, y = shape.corners[0]
        reach = max(abs(p - x) + abs(q - y) for p, q in shape.corners)
        index = self._around(x, y, reach + radius)
        own = self._free.select(index)
        for a, b in edges(shape):
            own = _cut(own, *self._stadium(own.lane, a, b, radius))
        outside = [not contains(shape, point) for point in self._middles(own)]
        self._put(index, own.select(np.flatnonzero(np.array(outside, dtype=np.bool_))))

    def block_intersections(self, radius: float) -> None:
        """Remove all places closer than `radius` to an intersection."""
        radius += SLACK
        segment, vertex = self._near.couples(radius)
        lane = np.concatenate([2 * segment, 2 * segment + 1])
        points = self._network.points[np.concatenate([vertex, vertex])]
        along, left = self._lines.relative(lane, points[:, 0], points[:, 1])
        low, high = chord(along, left, radius)
        hit = low < high
        self._free = _subtract(self._free, Intervals(lane[hit], low[hit], high[hit]))

    def choose(self, draws: Draws, lanes: Collection[int] | None = None) -> tuple[int, float] | None:
        """Return a lane and the metres along it, uniform over all free places (of `lanes`), or None."""
        lane, low, high = self._free
        width = high - low
        if lanes is not None:
            width = np.where(np.isin(lane, list(lanes)), width, 0.0)
        ends = np.cumsum(width)
        if not len(ends) or not ends[-1] > 0.0:
            return None
        pick = draws.uniform(0.0, float(ends[-1]))
        k = min(int(np.searchsorted(ends, pick, side="right")), int(np.flatnonzero(width > 0.0)[-1]))
        along = float(low[k]) + (pick - float(ends[k] - width[k]))
        return int(lane[k]), min(max(along, float(low[k])), float(high[k]))

    def first(self, order: Ints, lanes: Collection[int] | None = None) -> tuple[int, float] | None:
        """Return the beginning of the first free place, lanes taken by their rank in `order`, or None."""
        lane, low, _ = self._free
        if lanes is not None:
            allowed = np.isin(lane, list(lanes))
            lane, low = lane[allowed], low[allowed]
        if not len(lane):
            return None
        k = int(np.argmin(order[lane]))
        return int(lane[k]), float(low[k])

    def tables(self) -> tuple[Floats, Intervals]:
        """Return start and direction of each right lane's centre line, (L, 4), and the free intervals."""
        return np.ascontiguousarray(np.stack(self._lines, axis=-1)), self._free

    def pose(self, lane: int, along: float) -> Pose:
        """Return the pose `along` metres down a right lane, headed with it."""
        return self._lines.pose(lane, along)

    def _around(self, x: float, y: float, radius: float) -> Ints:
        """Return the numbers of the intervals of all lanes that may come closer than `radius` to (x, y)."""
        lanes = self._near.lanes(x, y, radius)
        if lanes is None:
            return np.arange(len(self._free.lane))
        begin = np.searchsorted(self._free.lane, lanes, side="left")
        end = np.searchsorted(self._free.lane, lanes, side="right")
        count = end - begin
        return np.repeat(begin - (np.cumsum(count) - count), count) + np.arange(int(count.sum()))

    def _put(self, index: Ints, new: Intervals) -> None:
        """Replace the intervals with the numbers `index`, which are all of their lanes, by `new`."""
        kept = np.ones(len(self._free.lane), dtype=np.bool_)
        kept[index] = False
        rest = self._free.select(np.flatnonzero(kept))
        place = np.searchsorted(rest.lane, new.lane)
        lane = np.insert(rest.lane, place, new.lane).astype(np.int64)
        low = np.insert(rest.low, place, new.low).astype(np.float64)
        self._free = Intervals(lane, low, np.insert(rest.high, place, new.high).astype(np.float64))

    def _middles(self, own: Intervals) -> list[Point]:
        x, y = self._lines.points(own.lane, 0.5 * (own.low + own.high))
        return list(zip(x.tolist(), y.tolist(), strict=True))

    def _stadium(self, lane: Ints, a: Point, b: Point, radius: float) -> tuple[Floats, Floats]:
        """Return where lanes are closer than `radius` to the edge ab: in two discs or the box between them."""
        low, high = chord(*self._lines.relative(lane, *a), radius)
        other_low, other_high = chord(*self._lines.relative(lane, *b), radius)
        low, high = np.minimum(low, other_low), np.maximum(high, other_high)
        if a != b:
            box_low, box_high = band(self._lines, lane, a, b, radius)
            hit = box_low < box_high
            low = np.where(hit, np.minimum(low, box_low), low)
            high = np.where(hit, np.maximum(high, box_high), high)
        return low, high


class _Near:
    """Finds the lanes near a point by uniform cells."""

    def __init__(self, network: RoadNetwork, w: float) -> None:
        self._network = network
        self._w = w
        self._start, self._end = network.runs.start, network.runs.end
        self._size = float(network.lengths.mean())
        self._cells: dict[tuple[int, int], list[int]] | None = None

    def lanes(self, x: float, y: float, radius: float) -> Ints | None:
        """Return the lanes that may come closer than `radius` to (x, y), ascending; None for all of them."""
        reach = radius + self._w
        if reach > 2.0 * self._size:
            return None
        cells = self._table()
        columns = range(floor((x - reach) / self._size), ceil((x + reach) / self._size))
        rows = range(floor((y - reach) / self._size), ceil((y + reach) / self._size))
        found = {s for column in columns for row in rows for s in cells.get((column, row), ())}
        segments = np.array(sorted(found), dtype=np.int64)
        return np.stack([2 * segments, 2 * segments + 1], axis=-1).ravel()

    def couples(self, radius: float) -> tuple[Ints, Ints]:
        """Return segments and intersections that may be closer than `radius` to a lane of the segment."""
        points, count = self._network.points, len(self._start)
        start, end = np.concatenate([self._start, points]), np.concatenate([self._end, points])
        reach = radius + self._w
        size = max(self._size, reach)
        segments: list[Ints] = []
        vertices: list[Ints] = []
        for first, second in pairs(*covered(start, end, 0.5 * reach, size)):
            low, high = np.minimum(first, second), np.maximum(first, second)
            mixed = (low < count) & (high >= count)
            segments.append(low[mixed])
            vertices.append(high[mixed] - count)
        return np.concatenate(segments), np.concatenate(vertices)

    def _table(self) -> dict[tuple[int, int], list[int]]:
        if self._cells is None:
            self._cells = {}
            item, column, row = covered(self._start, self._end, 0.0, self._size)
            for s, i, j in zip(item.tolist(), column.tolist(), row.tolist(), strict=True):
                self._cells.setdefault((i, j), []).append(s)
        return self._cells


def _cut(own: Intervals, low: Floats, high: Floats) -> Intervals:
    """Take the open interval (low, high) out of each interval."""
    hit = (low < own.high) & (high > own.low) & (low < high)
    if not bool(np.any(hit)):
        return own
    before = np.flatnonzero(hit & (low >= own.low))
    after = np.flatnonzero(hit & (high <= own.high))
    kept = own.select(np.flatnonzero(~hit))
    lane = np.concatenate([kept.lane, own.lane[before], own.lane[after]])
    new_low = np.concatenate([kept.low, own.low[before], high[after]])
    new_high = np.concatenate([kept.high, low[before], own.high[after]])
    return Intervals(lane, new_low, new_high).select(np.lexsort((new_low, lane)))


def _subtract(own: Intervals, blocked: Intervals) -> Intervals:
    """Take all of `blocked` out of `own` at once: what is left are the gaps of all that is not free."""
    first = np.flatnonzero(np.diff(own.lane, prepend=-1))
    last = np.flatnonzero(np.diff(own.lane, append=-1))
    joints = np.flatnonzero(np.diff(own.lane, append=-1) == 0)
    taken = np.isin(blocked.lane, own.lane)
    lane = np.concatenate([blocked.lane[taken], own.lane[first], own.lane[last], own.lane[joints]])
    low = np.concatenate([blocked.low[taken], np.full(len(first), -np.inf), own.high[last], own.high[joints]])
    high = np.concatenate(
        [blocked.high[taken], own.low[first], np.full(len(last), np.inf), own.low[joints + 1]]
    )
    order = np.lexsort((low, lane))
    lane, low, high = lane[order], low[order], high[order]
    ranked = np.sort(high)
    rank = np.searchsorted(ranked, high)
    farthest = ranked[np.maximum.accumulate(lane * len(lane) + rank) % max(len(lane), 1)]
    gap = np.flatnonzero((lane[1:] == lane[:-1]) & (low[1:] > farthest[:-1]))
    return Intervals(lane[gap], farthest[gap], low[gap + 1])
