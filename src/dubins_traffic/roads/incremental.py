"""Networks grown freely: roads added one by one at random bearings, each checked against those around it."""

from __future__ import annotations

from math import ceil, floor, pi, sqrt

from dubins_traffic.kernels.philox import Draws
from dubins_traffic.roads.checks import LARGEST_DEGREE
from dubins_traffic.roads.clearance import ROUNDING, Clearances

LONGEST = 1.8
"""Roads are at most this many times as long as they must be."""
GROWN = 1.5
"""And those of the tree at most this many times."""
TRIES = 16
"""An intersection at which so many roads did not fit grows no more (more where only few bearings do)."""

Point = tuple[int, int]


class Sketch:
    """Roads between points of the integer lattice that keep the clearances.

    Parameters
    ----------
    least : Clearances
        In lattice units.
    minimum_angle : float
        Least angle between two roads at an intersection, radians: says how often to try.
    """

    def __init__(self, least: Clearances, minimum_angle: float) -> None:
        self.points: list[Point] = []
        self.roads: list[tuple[int, int]] = []
        self._least = least
        self._longest = LONGEST * least.length
        self._cosine = least.cosine - ROUNDING
        self._tries = ceil(TRIES * pi / max(pi - minimum_angle, 0.02))
        self._arms: list[list[int]] = []
        self._near_points: dict[Point, list[int]] = {}
        self._near_roads: dict[Point, list[tuple[int, int]]] = {}

    def grow(self, draws: Draws, count: int) -> bool:
        """Draw a tree of `count` intersections; False if it did not find the room."""
        self._add_point((0, 0))
        reach = floor(GROWN * self._least.length)
        around = range(-reach, reach + 1)
        offsets = [
            (x, y) for x in around for y in around if self._fair(x, y) and x * x + y * y <= reach * reach
        ]
        failures = [0]
        active = [0]
        while len(self.points) < count and active:
            u = draws.uniform()
            k = int(u * u * len(active))
            a = active[k]
            dx, dy = offsets[draws.below(len(offsets))]
            q = (self.points[a][0] + dx, self.points[a][1] + dy)
            if self._fits(a, q, None):
                b = self._add_point(q)
                self._add_road(a, b)
                active.append(b)
                failures.append(0)
            else:
                failures[a] += 1
                if failures[a] >= self._tries:
                    del active[k]
        return len(self.points) == count

    def connect(self, draws: Draws, roads: int) -> None:
        """Add roads between the points, in random order, until there are `roads` or no other fits."""
        couples = [
            (a, b)
            for a, p in enumerate(self.points)
            for b in self._points_around(p)
            if a < b and self._fair(self.points[b][0] - p[0], self.points[b][1] - p[1])
        ]
        couples.sort()
        for k in draws.shuffled(len(couples)):
            if len(self.roads) >= roads:
                break
            a, b = couples[k]
            if b not in self._arms[a] and self._fits(a, self.points[b], b):
                self._add_road(a, b)

    def _fair(self, dx: int, dy: int) -> bool:
        return self._least.length <= sqrt(dx * dx + dy * dy) <= self._longest

    def _fits(self, a: int, q: Point, b: int | None) -> bool:
        """Whether a road from intersection a to the point q (intersection b, or a new one) fits in."""
        p = self.points[a]
        if not self._turns(a, q) or (b is not None and not self._turns(b, p)):
            return False
        middle = ((p[0] + q[0]) // 2, (p[1] + q[1]) // 2)
        for v in self._points_around(middle):
            r = self.points[v]
            if v not in (a, b) and _distance(r, p, q) < self._least.aside:
                return False
            if b is None and _distance(r, q, q) < self._least.apart:
                return False
        for c, d in self._roads_around(middle):
            r, t = self.points[c], self.points[d]
            if b is None and _distance(q, r, t) < self._least.aside:
                return False
            if not {a, b} & {c, d} and _cross(p, q, r, t):
                return False
        return True

    def _turns(self, v: int, q: Point) -> bool:
        """Whether intersection v may have another road, toward q."""
        x, y = self.points[v]
        dx, dy = q[0] - x, q[1] - y
        if len(self._arms[v]) >= LARGEST_DEGREE:
            return False
        for other in self._arms[v]:
            ex, ey = self.points[other][0] - x, self.points[other][1] - y
            if dx * ex + dy * ey > self._cosine * sqrt((dx * dx + dy * dy) * (ex * ex + ey * ey)):
                return False
        return True

    def _add_point(self, point: Point) -> int:
        self.points.append(point)
        self._arms.append([])
        self._near_points.setdefault(self._cell(point), []).append(len(self.points) - 1)
        return len(self.points) - 1

    def _add_road(self, a: int, b: int) -> None:
        (x0, y0), (x1, y1) = self.points[a], self.points[b]
        self.roads.append((a, b))
        self._arms[a].append(b)
        self._arms[b].append(a)
        self._near_roads.setdefault(self._cell(((x0 + x1) // 2, (y0 + y1) // 2)), []).append((a, b))

    def _cell(self, point: Point) -> Point:
        side = self._longest + 2.0
        return floor(point[0] / side), floor(point[1] / side)

    def _points_around(self, point: Point) -> list[int]:
        x, y = self._cell(point)
        cells = [(i, j) for i in (x - 1, x, x + 1) for j in (y - 1, y, y + 1)]
        return [v for cell in cells for v in self._near_points.get(cell, ())]

    def _roads_around(self, point: Point) -> list[tuple[int, int]]:
        x, y = self._cell(point)
        cells = [(i, j) for i in (x - 1, x, x + 1) for j in (y - 1, y, y + 1)]
        return [road for cell in cells for road in self._near_roads.get(cell, ())]


def _distance(r: Point, p: Point, q: Point) -> float:
    """Return the distance from r to the segment from p to q."""
    dx, dy, rx, ry = q[0] - p[0], q[1] - p[1], r[0] - p[0], r[1] - p[1]
    square = dx * dx + dy * dy
    along = min(max((rx * dx + ry * dy) / square, 0.0), 1.0) if square else 0.0
    rx, ry = rx - along * dx, ry - along * dy
    return sqrt(rx * rx + ry * ry)


def _cross(p: Point, q: Point, r: Point, t: Point) -> bool:
    """Whether the segments pq and rt meet."""
    return _side(p, q, r) * _side(p, q, t) <= 0 and _side(r, t, p) * _side(r, t, q) <= 0


def _side(p: Point, q: Point, r: Point) -> int:
    turn = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
    return (turn > 0) - (turn < 0)
