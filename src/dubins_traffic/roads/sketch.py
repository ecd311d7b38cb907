"""Random networks that grow freely: a tree of roads between points of the lattice, then others where they fit."""

from __future__ import annotations

from functools import lru_cache
from math import ceil, floor, pi, sqrt
from threading import get_ident
from typing import TYPE_CHECKING

import numpy as np

from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.calls import bound
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.records import Rows, record, table
from dubins_traffic.kernels.stream import Stream, next_below, next_uniform, set_stream, shuffle
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.roads.closeness import ROUNDING, Bucket, bucket_of, buckets, empty
from dubins_traffic.roads.room import LARGEST_DEGREE, Clearances

if TYPE_CHECKING:
    from dubins_traffic.kernels.philox import Draws

LONGEST = 1.8
"""Roads are at most this many times as long as they must be."""
GROWN = 1.5
"""And those of the tree at most this many times."""
TRIES = 16
"""An intersection at which so many roads did not fit grows no more (more where only few bearings do)."""
ATTEMPTS = 3
"""So often is it tried to grow a network."""
COUPLES = 16
"""Roads that may be added are at most so many for each intersection, else room is made for more."""
Drawn = tuple[list[tuple[int, int]], list[tuple[int, int]]]
"""Points of the lattice, and roads as pairs of their numbers."""


@record
class Plan:
    """What a sketch is to become, in lattice units, and how far it is."""

    intersections: int
    """How many are wanted."""
    segments: int
    """How many roads are wanted."""
    length: float
    """Least length of a road."""
    longest: float
    """Largest length of a road."""
    apart: float
    """Least distance between intersections."""
    aside: float
    """Least distance from an intersection to a road beside it."""
    cosine: float
    """Largest cosine of the angle between two roads at an intersection."""
    degree: int
    """Most roads at an intersection."""
    tries: int
    """An intersection at which so many roads did not fit grows no more."""
    side: float
    """Side of a cell."""
    spots: int
    """Number of intersections so far."""
    roads: int
    """Number of roads so far."""
    left: int
    """How many more attempts there are."""
    is_growing: int
    """Whether there is a tree, to which roads are to be added."""
    is_whole: int
    """Whether it has all that is wanted."""
    most: int
    """The most roads that an attempt has made."""


@record
class Spot:
    """An intersection."""

    x: int
    """The lattice point."""
    y: int
    """Its second coordinate."""
    column: int
    """Its cell."""
    row: int
    """The row of the cell."""
    following: int
    """The next one in its bucket, -1 for none."""
    failures: int
    """How many roads out of it did not fit."""
    degree: int
    """Number of roads out of it."""
    arm0: int
    """The intersection at the other end of the first that was drawn."""
    arm1: int
    """Of the second."""
    arm2: int
    """Of the third."""
    arm3: int
    """Of the fourth."""


@record
class Road:
    """A road between two intersections."""

    a: int
    """The intersection at its first end."""
    b: int
    """And at its second."""
    column: int
    """The cell of its middle."""
    row: int
    """The row of the cell."""
    following: int
    """The next one in its bucket, -1 for none."""


class Sketch(Tables):
    """A network under way.

    `active` (N,): the intersections that may grow; `offset` (K, 2): steps to where a new one may be; `couple` (M, 2):
    intersections that a road may join; `order` (M,): their numbers in random order.
    """

    spot: Rows[Spot]
    road: Rows[Road]
    near_spot: Rows[Bucket]
    near_road: Rows[Bucket]
    active: Ints
    offset: Ints
    couple: Ints
    order: Ints


class Sketcher:
    """Grows networks of `count` intersections and `roads` roads, of at least `length` lattice units each."""

    def __init__(self, count: int, roads: int, length: float) -> None:
        self.plan, self.stream = table(Plan, 1)[0], table(Stream, 1)[0]
        self.plan.intersections, self.plan.segments = count, roads
        self.plan.length, self.plan.longest = length, LONGEST * length
        self.plan.degree = LARGEST_DEGREE
        self.plan.side = self.plan.longest + 2.0
        self.tables = Sketch(
            spot=table(Spot, count), road=table(Road, max(roads, count)), near_spot=buckets(count),
            near_road=buckets(roads), active=np.zeros(count, dtype=np.int64), offset=_offsets(length),
            couple=np.zeros((COUPLES * count, 2), dtype=np.int64), order=np.zeros(COUPLES * count, dtype=np.int64),
        )  # fmt: skip
        self._sketch = bound(sketch)

    def run(self, draws: Draws, least: Clearances, tries: int) -> None:
        """Grow a network; the arguments are as of `sketched`."""
        plan, stream = self.plan, self.stream
        plan.apart, plan.aside, plan.cosine = least.apart, least.aside, least.cosine - ROUNDING
        plan.tries, plan.left = tries, ATTEMPTS
        plan.is_growing = plan.is_whole = plan.most = 0
        set_stream(stream, draws)
        while status := self._sketch(plan, self.tables, stream):
            couple, order = np.zeros((status, 2), dtype=np.int64), np.zeros(status, dtype=np.int64)
            self.tables = self.tables.replace(couple=couple, order=order)
        draws.go_to(stream.drawn)


def sketched(draws: Draws, count: int, roads: int, least: Clearances, minimum_angle: float) -> tuple[Drawn | None, int]:
    """Return a network that has been grown and how many roads it has; None if it has not found the room.

    Parameters
    ----------
    draws : Draws
        Random numbers; they stand where it has left them.
    count, roads : int
        How many intersections and roads are wanted.
    least : Clearances
        In lattice units.
    minimum_angle : float
        Least angle between two roads at an intersection, radians: says how often to try.
    """
    drawing = _sketcher(count, roads, least.length, get_ident())
    drawing.run(draws, least, ceil(TRIES * pi / max(pi - minimum_angle, 0.02)))
    if drawing.plan.is_whole == 0:
        return None, drawing.plan.most
    spot, road = drawing.tables.spot, drawing.tables.road
    points = zip(spot["x"].tolist(), spot["y"].tolist(), strict=True)
    ends = zip(road["a"][:roads].tolist(), road["b"][:roads].tolist(), strict=True)
    return (list(points), list(ends)), roads


@lru_cache(maxsize=16)
def _sketcher(count: int, roads: int, length: float, _thread: int) -> Sketcher:
    """Return what grows such networks in a thread: its tables are made once."""
    return Sketcher(count, roads, length)


@lru_cache(maxsize=64)
def _offsets(length: float) -> Ints:
    """Return the steps (K, 2) from an intersection to where a new one may be, for roads of so many units at least."""
    reach = floor(GROWN * length)
    x, y = (part.ravel() for part in np.mgrid[-reach : reach + 1, -reach : reach + 1])
    square = x * x + y * y
    far = np.sqrt(square)
    fair = (length <= far) & (far <= LONGEST * length) & (square <= reach * reach)
    return np.stack([x[fair], y[fair]], axis=-1)


@jit
def sketch(plan: Plan, drawing: Sketch, stream: Stream) -> int:
    """Try to grow a network, as often as `Plan.left` says; `Plan.is_whole` tells whether it has been done.

    Returns the number of couples for which there has to be room to go on, from the last tree; 0 when it has ended.
    """
    while plan.is_growing == 1 or plan.left > 0:
        if plan.is_growing == 0:
            plan.left -= 1
            _clear(plan, drawing)
            plan.is_growing = 1 if _grow(plan, drawing, stream) else 0
        if plan.is_growing == 1:
            couples = _find_couples(plan, drawing)
            if couples > drawing.couple.shape[0]:
                return couples
            plan.is_growing = 0
            _connect(plan, drawing, couples, stream)
            if plan.roads == plan.segments:
                plan.is_whole = 1
                return 0
        plan.most = max(plan.most, plan.roads)
    return 0


@jit
def _clear(plan: Plan, drawing: Sketch) -> None:
    plan.spots = 0
    plan.roads = 0
    empty(drawing.near_spot)
    empty(drawing.near_road)


@jit
def _grow(plan: Plan, drawing: Sketch, stream: Stream) -> bool:
    """Draw a tree of as many intersections as are wanted; return whether it found the room."""
    _add_spot(plan, drawing, 0, 0)
    drawing.active[0] = 0
    count = 1
    while plan.spots < plan.intersections and count > 0:
        u = next_uniform(stream)
        k = int(u * u * count)
        a = int(drawing.active[k])
        pick = next_below(stream, drawing.offset.shape[0])
        x = drawing.spot[a].x + drawing.offset[pick, 0]
        y = drawing.spot[a].y + drawing.offset[pick, 1]
        if _fits(plan, drawing, a, -1, x, y):
            b = _add_spot(plan, drawing, x, y)
            _add_road(plan, drawing, a, b)
            drawing.active[count] = b
            count += 1
        else:
            drawing.spot[a].failures += 1
            if drawing.spot[a].failures >= plan.tries:
                count -= 1
                for i in range(k, count):
                    drawing.active[i] = drawing.active[i + 1]
    return plan.spots == plan.intersections


@jit
def _find_couples(plan: Plan, drawing: Sketch) -> int:
    """Return how many roads may be added as far as their length is concerned; write them in order, if there is room."""
    couples = 0
    for a in range(plan.spots):
        spot = drawing.spot[a]
        begin = couples
        for cell in range(9):
            column = spot.column + cell // 3 - 1
            row = spot.row + cell % 3 - 1
            b = drawing.near_spot[bucket_of(drawing.near_spot, column, row)].first
            while b >= 0:
                other = drawing.spot[b]
                if b > a and other.column == column and other.row == row:
                    dx = other.x - spot.x
                    dy = other.y - spot.y
                    far = sqrt(float(dx * dx + dy * dy))
                    if plan.length <= far <= plan.longest:
                        if couples < drawing.couple.shape[0]:
                            _insert(drawing.couple, begin, couples, a, b)
                        couples += 1
                b = other.following
    return couples


@jit
def _insert(couples: Ints, begin: int, end: int, a: int, b: int) -> None:
    """Write a couple behind those of the same first intersection, from `begin` on, whose second one is lower."""
    k = end
    while k > begin and couples[k - 1, 1] > b:
        couples[k, 1] = couples[k - 1, 1]
        k -= 1
    couples[end, 0] = a
    couples[k, 1] = b


@jit
def _connect(plan: Plan, drawing: Sketch, count: int, stream: Stream) -> None:
    """Add roads of the first `count` couples, in random order, until there are enough or no other fits."""
    shuffle(stream, drawing.order, count)
    for k in range(count):
        if plan.roads >= plan.segments:
            break
        a = int(drawing.couple[drawing.order[k], 0])
        b = int(drawing.couple[drawing.order[k], 1])
        joined = False
        for i in range(drawing.spot[a].degree):
            joined = joined or _arm(drawing.spot[a], i) == b
        if not joined and _fits(plan, drawing, a, b, drawing.spot[b].x, drawing.spot[b].y):
            _add_road(plan, drawing, a, b)


@jit
def _arm(spot: Spot, k: int) -> int:
    if k == 0:
        return spot.arm0
    if k == 1:
        return spot.arm1
    return spot.arm2 if k == 2 else spot.arm3


@jit
def _add_arm(spot: Spot, v: int) -> None:
    if spot.degree == 0:
        spot.arm0 = v
    elif spot.degree == 1:
        spot.arm1 = v
    elif spot.degree == 2:
        spot.arm2 = v
    else:
        spot.arm3 = v
    spot.degree += 1


@jit
def _add_spot(plan: Plan, drawing: Sketch, x: int, y: int) -> int:
    """Add an intersection; return its number."""
    number = plan.spots
    spot = drawing.spot[number]
    spot.degree = 0
    spot.failures = 0
    spot.x = x
    spot.y = y
    spot.column = floor(x / plan.side)
    spot.row = floor(y / plan.side)
    bucket = drawing.near_spot[bucket_of(drawing.near_spot, spot.column, spot.row)]
    spot.following = bucket.first
    bucket.first = number
    plan.spots = number + 1
    return number


@jit
def _add_road(plan: Plan, drawing: Sketch, a: int, b: int) -> None:
    """Add a road between two intersections."""
    number = plan.roads
    road, p, q = drawing.road[number], drawing.spot[a], drawing.spot[b]
    road.a = a
    road.b = b
    road.column = floor(((p.x + q.x) >> 1) / plan.side)
    road.row = floor(((p.y + q.y) >> 1) / plan.side)
    bucket = drawing.near_road[bucket_of(drawing.near_road, road.column, road.row)]
    road.following = bucket.first
    bucket.first = number
    plan.roads = number + 1
    _add_arm(p, b)
    _add_arm(q, a)


@jit
def _fits(plan: Plan, drawing: Sketch, a: int, b: int, x: int, y: int) -> bool:
    """Return whether a road from intersection a to the point q = (x, y), of intersection b or of none (-1), fits in."""
    p = drawing.spot[a]
    if not _turns(plan, drawing, a, x, y) or (b >= 0 and not _turns(plan, drawing, b, p.x, p.y)):
        return False
    first = floor(((p.x + x) >> 1) / plan.side) - 1
    lowest = floor(((p.y + y) >> 1) / plan.side) - 1
    for cell in range(9):
        column = first + cell // 3
        row = lowest + cell % 3
        v = drawing.near_spot[bucket_of(drawing.near_spot, column, row)].first
        while v >= 0:
            spot = drawing.spot[v]
            if spot.column == column and spot.row == row:
                if v not in (a, b) and _distance(spot.x, spot.y, p.x, p.y, x, y) < plan.aside:
                    return False
                if b < 0 and _distance(spot.x, spot.y, x, y, x, y) < plan.apart:
                    return False
            v = spot.following
        s = drawing.near_road[bucket_of(drawing.near_road, column, row)].first
        while s >= 0:
            road = drawing.road[s]
            if road.column == column and road.row == row:
                r, t = drawing.spot[road.a], drawing.spot[road.b]
                if b < 0 and _distance(x, y, r.x, r.y, t.x, t.y) < plan.aside:
                    return False
                apart = a not in (road.a, road.b) and b not in (road.a, road.b)
                if apart and _cross(p, x, y, r, t):
                    return False
            s = road.following
    return True


@jit
def _turns(plan: Plan, drawing: Sketch, v: int, x: int, y: int) -> bool:
    """Return whether intersection v may have another road, toward the lattice point (x, y)."""
    spot = drawing.spot[v]
    if spot.degree >= plan.degree:
        return False
    dx = x - spot.x
    dy = y - spot.y
    for k in range(spot.degree):
        other = drawing.spot[_arm(spot, k)]
        ex = other.x - spot.x
        ey = other.y - spot.y
        if dx * ex + dy * ey > plan.cosine * sqrt(float((dx * dx + dy * dy) * (ex * ex + ey * ey))):
            return False
    return True


@jit
def _distance(rx: int, ry: int, px: int, py: int, qx: int, qy: int) -> float:
    """Return the distance from the point r to the segment from p to q."""
    dx = qx - px
    dy = qy - py
    away_x = rx - px
    away_y = ry - py
    square = dx * dx + dy * dy
    along = 0.0
    if square != 0:
        along = min(max((away_x * dx + away_y * dy) / square, 0.0), 1.0)
    left_x = away_x - along * dx
    left_y = away_y - along * dy
    return sqrt(left_x * left_x + left_y * left_y)


@jit
def _cross(p: Spot, x: int, y: int, r: Spot, t: Spot) -> bool:
    """Return whether the segments from p to (x, y) and from r to t meet."""
    if _side(p.x, p.y, x, y, r) * _side(p.x, p.y, x, y, t) > 0:
        return False
    return _side(r.x, r.y, t.x, t.y, p) * _turn(r.x, r.y, t.x, t.y, x, y) <= 0


@jit
def _side(px: int, py: int, qx: int, qy: int, r: Spot) -> int:
    return _turn(px, py, qx, qy, r.x, r.y)


@jit
def _turn(px: int, py: int, qx: int, qy: int, x: int, y: int) -> int:
    """Return on which side of the line from p to q a point lies: 1, 0 or -1."""
    turn = (qx - px) * (y - py) - (qy - py) * (x - px)
    return (1 if turn > 0 else 0) - (1 if turn < 0 else 0)
