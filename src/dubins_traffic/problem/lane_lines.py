"""The centre lines of right lanes as arrays, and where lines are inside discs and boxes."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from dubins_traffic.cars.state import Pose
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.problem.overlap import Point
from dubins_traffic.roads.network import RoadNetwork


class Lines(NamedTuple):
    """Lines by lane: where they start (ax, ay), metres, and their direction (tx, ty), a unit vector; arrays (L,)."""

    ax: Floats
    ay: Floats
    tx: Floats
    ty: Floats

    @staticmethod
    def right(network: RoadNetwork, w: float) -> Lines:
        """Return the centre lines of the right lanes, `w` metres right of the segments': the longest straight runs."""
        lanes = np.arange(network.lanes)
        segment, back = lanes >> 1, (lanes & 1).astype(np.bool_)
        runs = network.runs
        tangent = np.where(back[:, None], -runs.tangent[segment], runs.tangent[segment])
        start = np.where(back[:, None], runs.end[segment], runs.start[segment])
        tx, ty = tangent[:, 0] + 0.0, tangent[:, 1] + 0.0  # no negative zeros
        return Lines(start[:, 0] + w * ty, start[:, 1] - w * tx, tx, ty)

    def relative(self, lane: Ints, x: Floats | float, y: Floats | float) -> tuple[Floats, Floats]:
        """Return metres to (x, y) along the lines of `lane` (K,) and to the left of them."""
        tx, ty = self.tx[lane], self.ty[lane]
        rx, ry = x - self.ax[lane], y - self.ay[lane]
        return rx * tx + ry * ty, tx * ry - ty * rx

    def points(self, lane: Ints, along: Floats) -> tuple[Floats, Floats]:
        """Return x and y of the points `along` metres down the lines of `lane` (K,)."""
        return self.ax[lane] + along * self.tx[lane], self.ay[lane] + along * self.ty[lane]

    def pose(self, lane: int, along: float) -> Pose:
        """Return the pose `along` metres down a line, headed along it."""
        tx, ty = float(self.tx[lane]), float(self.ty[lane])
        return Pose(float(self.ax[lane]) + along * tx, float(self.ay[lane]) + along * ty, tx, ty)


def chord(along: Floats, left: Floats, radius: float) -> tuple[Floats, Floats]:
    """Return where lines enter and leave a disc centred `along` and `left` of them; inf, -inf where they miss it."""
    square = radius * radius - left * left
    half = np.sqrt(np.maximum(square, 0.0))
    hit = square > 0.0
    return np.where(hit, along - half, np.inf), np.where(hit, along + half, -np.inf)


def band(lines: Lines, lane: Ints, a: Point, b: Point, radius: float) -> tuple[Floats, Floats]:
    """Return where the lines of `lane` are inside the box of `radius` to both sides of the edge ab."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    length = sqrt(dx * dx + dy * dy)
    u, v = dx / length, dy / length
    tx, ty = lines.tx[lane], lines.ty[lane]
    rx, ry = lines.ax[lane] - a[0], lines.ay[lane] - a[1]
    low, high = _between(rx * u + ry * v, tx * u + ty * v, 0.0, length)
    other_low, other_high = _between(ry * u - rx * v, ty * u - tx * v, -radius, radius)
    return np.maximum(low, other_low), np.minimum(high, other_high)


def _between(offset: Floats, rate: Floats, low: float, high: float) -> tuple[Floats, Floats]:
    """Return the s for which offset + rate * s lies between `low` and `high`."""
    steep = rate != 0.0
    slope = np.where(steep, rate, 1.0)
    a, b = (low - offset) / slope, (high - offset) / slope
    inside = (offset > low) & (offset < high)
    first = np.where(steep, np.minimum(a, b), np.where(inside, -np.inf, np.inf))
    last = np.where(steep, np.maximum(a, b), np.where(inside, np.inf, -np.inf))
    return first, last
