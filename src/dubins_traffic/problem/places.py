"""Free places for cars on the right lanes of a network: intervals of the lanes' centre lines, cut by what is there.

Places are found exactly, not by trial and error, so that "does not fit" is a fact. All bits follow from
+ - * / and square roots in a fixed order.
"""

from __future__ import annotations

from collections.abc import Collection
from math import sqrt

import numpy as np
import numpy.typing as npt

from dubins_traffic.cars.state import Pose
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.problem.overlap import Point, Shape, contains, edges
from dubins_traffic.roads.network import RoadNetwork

SLACK = 1e-9
"""Added to every clearance, metres, so that rounding never eats into it."""

Mask = npt.NDArray[np.bool_]


class Places:
    """Intervals of right lanes' centre lines in which the centre of a car may stand.

    Parameters
    ----------
    network : RoadNetwork
        The roads.
    w : float
        The right lane's centre line is this far right of the segment's, metres.
    """

    def __init__(self, network: RoadNetwork, w: float) -> None:
        lanes = np.arange(network.lanes)
        segment, back = lanes >> 1, (lanes & 1).astype(bool)
        tangent = np.where(back[:, None], -network.tangents[segment], network.tangents[segment])
        start = network.points[np.where(back, network.ends[segment, 1], network.ends[segment, 0])]
        self._tx, self._ty = tangent[:, 0] + 0.0, tangent[:, 1] + 0.0  # no negative zeros
        self._ax, self._ay = start[:, 0] + w * self._ty, start[:, 1] - w * self._tx
        self._lane: Ints = lanes
        self._low: Floats = np.zeros(len(lanes))
        self._high: Floats = network.lengths[segment].copy()

    @property
    def count(self) -> int:
        """Number of lanes of the network."""
        return len(self._tx)

    def copy(self) -> Places:
        """Return a copy that may be cut on its own."""
        twin = object.__new__(Places)
        twin.__dict__.update(self.__dict__)
        return twin

    def block(self, x: float, y: float, radius: float) -> None:
        """Take away what is closer than `radius` to (x, y)."""
        along, left = self._relative(x, y)
        self._cut(*_chord(along, left, radius + SLACK))

    def block_shape(self, shape: Shape, clearance: float) -> None:
        """Take away what is closer than `clearance` to a shape, or inside it."""
        for a, b in edges(shape):
            self._block_edge(a, b, shape.rounding + clearance + SLACK)
        middle = 0.5 * (self._low + self._high)
        x = self._ax[self._lane] + middle * self._tx[self._lane]
        y = self._ay[self._lane] + middle * self._ty[self._lane]
        points = zip(x.tolist(), y.tolist(), strict=True)
        self._keep(np.array([not contains(shape, point) for point in points], dtype=bool))

    def block_discs(self, centres: Floats, radius: float) -> None:
        """Take away what is closer than `radius` to any of `centres` (V, 2)."""
        for x, y in self._candidates(centres, radius + SLACK):
            self.block(x, y, radius)

    def choose(self, draws: Draws, lanes: Collection[int] | None = None) -> tuple[int, float] | None:
        """Return a lane and the metres along it, uniform over all free places (of `lanes`), or None."""
        width = self._high - self._low
        if lanes is not None:
            width = np.where(np.isin(self._lane, list(lanes)), width, 0.0)
        ends = np.cumsum(width)
        if not len(ends) or not ends[-1] > 0.0:
            return None
        pick = draws.uniform(0.0, float(ends[-1]))
        k = int(np.searchsorted(ends, pick, side="right"))
        k = min(k, int(np.flatnonzero(width > 0.0)[-1]))
        along = float(self._low[k]) + (pick - float(ends[k] - width[k]))
        return int(self._lane[k]), min(max(along, float(self._low[k])), float(self._high[k]))

    def first(self, order: Ints, lanes: Collection[int] | None = None) -> tuple[int, float] | None:
        """Return the beginning of the first free place, lanes taken by their rank in `order`, or None."""
        allowed = np.arange(len(self._lane))
        if lanes is not None:
            allowed = np.flatnonzero(np.isin(self._lane, list(lanes)))
        if not len(allowed):
            return None
        ranks = order[self._lane[allowed]]
        best = allowed[ranks == ranks.min()]
        k = int(best[np.argmin(self._low[best])])
        return int(self._lane[k]), float(self._low[k])

    def pose(self, lane: int, along: float) -> Pose:
        """Return the pose `along` metres down a right lane, headed with it."""
        tx, ty = float(self._tx[lane]), float(self._ty[lane])
        return Pose(float(self._ax[lane]) + along * tx, float(self._ay[lane]) + along * ty, tx, ty)

    def _relative(self, x: float, y: float) -> tuple[Floats, Floats]:
        """Return, for every interval, metres to (x, y) along its lane and to the left of it."""
        lane = self._lane
        tx, ty = self._tx[lane], self._ty[lane]
        rx, ry = x - self._ax[lane], y - self._ay[lane]
        return rx * tx + ry * ty, tx * ry - ty * rx

    def _candidates(self, centres: Floats, radius: float) -> list[Point]:
        """Return the centres that are closer than `radius` to some interval."""
        found: list[Point] = []
        for x, y in centres.tolist():
            along, left = self._relative(x, y)
            low, high = _chord(along, left, radius)
            if bool(np.any((low < self._high) & (high > self._low))):
                found.append((x, y))
        return found

    def _block_edge(self, a: Point, b: Point, radius: float) -> None:
        """Take away what is closer than `radius` to the edge ab: two discs and the box between them."""
        a_along, a_left = self._relative(*a)
        b_along, b_left = self._relative(*b)
        low, high = _chord(a_along, a_left, radius)
        other_low, other_high = _chord(b_along, b_left, radius)
        low, high = np.minimum(low, other_low), np.maximum(high, other_high)
        dx, dy = b[0] - a[0], b[1] - a[1]
        length = sqrt(dx * dx + dy * dy)
        if length > 0.0:
            u, v = dx / length, dy / length
            lane = self._lane
            rate_along = self._tx[lane] * u + self._ty[lane] * v
            rate_across = self._ty[lane] * u - self._tx[lane] * v
            rx, ry = self._ax[lane] - a[0], self._ay[lane] - a[1]
            box_low, box_high = _band(rx * u + ry * v, rate_along, 0.0, length)
            low_2, high_2 = _band(ry * u - rx * v, rate_across, -radius, radius)
            box_low, box_high = np.maximum(box_low, low_2), np.minimum(box_high, high_2)
            hit = box_low < box_high
            low = np.where(hit, np.minimum(low, box_low), low)
            high = np.where(hit, np.maximum(high, box_high), high)
        self._cut(low, high)

    def _cut(self, low: Floats, high: Floats) -> None:
        """Take the open interval (low, high) out of each interval."""
        hit = (low < self._high) & (high > self._low) & (low < high)
        if not bool(np.any(hit)):
            return
        before = hit & (low >= self._low)
        after = hit & (high <= self._high)
        lane = np.concatenate([self._lane[~hit], self._lane[before], self._lane[after]])
        new_low = np.concatenate([self._low[~hit], self._low[before], high[after]])
        new_high = np.concatenate([self._high[~hit], low[before], self._high[after]])
        order = np.lexsort((new_low, lane))
        self._lane, self._low, self._high = lane[order], new_low[order], new_high[order]

    def _keep(self, mask: Mask) -> None:
        self._lane, self._low, self._high = self._lane[mask], self._low[mask], self._high[mask]


def _chord(along: Floats, left: Floats, radius: float) -> tuple[Floats, Floats]:
    """Return where a line is inside a disc whose centre is `along` down the line and `left` of it."""
    square = radius * radius - left * left
    half = np.sqrt(np.maximum(square, 0.0))
    hit = square > 0.0
    return np.where(hit, along - half, np.inf), np.where(hit, along + half, -np.inf)


def _band(offset: Floats, rate: Floats, low: float, high: float) -> tuple[Floats, Floats]:
    """Return the s for which offset + rate * s lies between `low` and `high`."""
    steep = rate != 0.0
    slope = np.where(steep, rate, 1.0)
    a, b = (low - offset) / slope, (high - offset) / slope
    inside = (offset > low) & (offset < high)
    first = np.where(steep, np.minimum(a, b), np.where(inside, -np.inf, np.inf))
    last = np.where(steep, np.maximum(a, b), np.where(inside, np.inf, -np.inf))
    return first, last
