"""What is too near in a network of roads, compiled: intersections, roads beside them, roads that cross or meet sharply.

What is near is found by hashed cells as wide as the longest of the pieces that are compared; which of it is too near
is told by the exact comparisons of each.
"""

from __future__ import annotations

from functools import lru_cache
from math import floor, sqrt
from threading import get_ident
from typing import TYPE_CHECKING

import numpy as np

from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.calls import bound
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.records import Rows, record, table
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.roads.room import Clearances

if TYPE_CHECKING:
    from collections.abc import Callable


@record
class Bucket:
    """The items of all cells with one hash."""

    first: int = -1
    """Number of the first item, which names the next; -1 if there is none."""


def buckets(items: int) -> Rows[Bucket]:
    """Return empty buckets for so many items."""
    return table(Bucket, 1 << max(items, 8).bit_length())


@jit
def bucket_of(buckets: Rows[Bucket], column: int, row: int) -> int:
    """Return the number of the bucket that holds what is in a cell, its `column` (number) and `row` (number)."""
    return (column * 73_856_093 ^ row * 19_349_663) & (buckets.shape[0] - 1)


@jit
def empty(buckets: Rows[Bucket]) -> None:
    """Take all items out of the buckets."""
    for k in range(buckets.shape[0]):
        buckets[k].first = -1


ROUNDING = 1e-9
"""By how much lengths and cosines may fall short."""
WIDER = 1.000001
"""Cells are so much wider than they must be, for rounding."""


@record
class Hit:
    """Something that falls short: what has a part in it, each the number of an intersection or a segment, or -1.

    A segment alone is too short; two intersections are too close; a segment lies too near beside an intersection; two
    segments make too sharp an angle at an intersection; two segments alone meet elsewhere than at a common end. Of two
    the lower number comes first.
    """

    vertex: int = -1
    """An intersection."""
    other_vertex: int = -1
    """A second one."""
    segment: int = -1
    """A segment."""
    other_segment: int = -1
    """A second one."""


class Hits(Tables):
    """What falls short: as many rows of `row` as `filled` (1,) says, as far as there are so many."""

    row: Rows[Hit]
    filled: Ints


@record
class Node:
    """An intersection."""

    x: float
    """Where it lies, in metres or lattice units."""
    y: float
    """Its second coordinate."""
    column: int
    """Its cell."""
    rank: int
    """The row of the cell."""
    following: int
    """The next one in its bucket, -1 for none."""


@record
class Bar:
    """A straight piece of a road."""

    x0: float
    """Where it begins, in metres or lattice units."""
    y0: float
    """Its second coordinate."""
    x1: float
    """Where it ends."""
    y1: float
    """Its second coordinate."""
    a: int
    """The intersection at the first end of its road."""
    b: int
    """And at the second."""
    owner: int
    """The segment of which it is a piece."""
    column: int
    """The cell of its middle."""
    rank: int
    """The row of the cell."""
    following: int
    """The next one in its bucket, -1 for none."""


@record
class Arm:
    """A road out of an intersection."""

    hub: int
    """The intersection."""
    segment: int
    """The road's segment."""
    dx: float
    """The unit vector along the road where it leaves."""
    dy: float
    """Its second coordinate."""


class Frame(Tables):
    """A network whose distances are measured.

    `arm` (2 S,): the roads out of intersections, by these; `place` (V + 1,): scratch to put them in order.
    """

    node: Rows[Node]
    bar: Rows[Bar]
    arm: Rows[Arm]
    place: Ints
    near_node: Rows[Bucket]
    near_bar: Rows[Bucket]


def frame(nodes: int, bars: int, arms: int) -> Frame:
    """Return room for so many intersections, straight pieces of roads, and roads out of intersections."""
    return Frame(
        node=table(Node, nodes), bar=table(Bar, bars), arm=table(Arm, arms),
        place=np.zeros(nodes + 1, dtype=np.int64), near_node=buckets(nodes), near_bar=buckets(bars),
    )  # fmt: skip


def hits(room: int) -> Hits:
    """Return room for so much that falls short."""
    return Hits(row=table(Hit, room), filled=np.zeros(1, dtype=np.int64))


class Finder:
    """Finds what falls short in networks of so many intersections, straight pieces of roads, and roads out of these."""

    def __init__(self, nodes: int, bars: int, arms: int) -> None:
        self.frame = frame(nodes, bars, arms)
        self._hits = hits(max(nodes, bars))
        self._tight, self._crowded = bound(find_tight), bound(find_crowded)
        self._sharp, self._meetings = bound(find_sharp), bound(find_meetings)
        self._put_arms = bound(put_arms)

    def put_bars(self, start: Floats, end: Floats) -> None:
        """Write where pieces begin and end, (K, 2)."""
        bar = self.frame.bar
        bar["x0"], bar["y0"] = start.T
        bar["x1"], bar["y1"] = end.T

    def tight(self, least: Clearances) -> Ints:
        """Return what falls short where each piece is a whole segment, as `_all` does."""
        self._put_arms(self.frame)
        return self._all(lambda: self._tight(self.frame, least, self._hits))

    def crowded_and_sharp(self, least: Clearances) -> Ints:
        """Return what falls short but segments that are too short, as `_all` does; the arms are given, unit vectors."""

        def call() -> None:
            self._crowded(self.frame, least, self._hits)
            self._sharp(self.frame, least, self._hits)

        return self._all(call)

    def meetings(self) -> Ints:
        """Return which segments meet elsewhere than at common ends, as `_all` does."""
        return self._all(lambda: self._meetings(self.frame, self._hits))

    def _all(self, call: Callable[[], None]) -> Ints:
        """Return all that kernels find, (K, 4): the fields of `Hit`; call them again where the room is too small."""
        while True:
            self._hits.filled[0] = 0
            call()
            count = int(self._hits.filled[0])
            if count <= len(self._hits.row):
                return np.asarray(self._hits.row)[:count].view(np.int64).reshape(-1, 4).copy()
            self._hits = hits(count)


def finder(nodes: int, bars: int, arms: int) -> Finder:
    """Return a `Finder` of this thread's: its tables are made once."""
    return _finder(nodes, bars, arms, get_ident())


@lru_cache(maxsize=16)
def _finder(nodes: int, bars: int, arms: int, _thread: int) -> Finder:
    return Finder(nodes, bars, arms)


@jit
def _note(hits: Hits, vertex: int, other_vertex: int, segment: int, other_segment: int) -> None:
    """Note what falls short, as `Hit` has it, if there is room, and count it."""
    count = int(hits.filled[0])
    if count < hits.row.shape[0]:
        hit = hits.row[count]
        hit.vertex = vertex
        hit.other_vertex = other_vertex
        hit.segment = segment
        hit.other_segment = other_segment
    hits.filled[0] = count + 1


@jit
def norm(x: float, y: float) -> float:
    """Return the length of a vector; `x` (m) and `y` (m) may be in lattice units as well."""
    return sqrt(x * x + y * y)


@jit
def find_tight(frame: Frame, least: Clearances, hits: Hits) -> None:
    """Note what falls short of `least` in a network whose arms are in order: `find_short` to `find_sharp`."""
    find_short(frame, least, hits)
    find_crowded(frame, least, hits)
    find_sharp(frame, least, hits)


@jit
def find_short(frame: Frame, least: Clearances, hits: Hits) -> None:
    """Note the pieces that are too short."""
    for k in range(frame.bar.shape[0]):
        bar = frame.bar[k]
        if norm(bar.x1 - bar.x0, bar.y1 - bar.y0) < least.length - ROUNDING:
            _note(hits, -1, -1, bar.owner, -1)


@jit
def find_crowded(frame: Frame, least: Clearances, hits: Hits) -> None:
    """Note the pairs of intersections that are too close, and of intersections and roads beside them."""
    _file(frame, max(least.apart, least.aside))
    for v in range(frame.node.shape[0]):
        node = frame.node[v]
        for cell in range(9):
            column = node.column + cell // 3 - 1
            rank = node.rank + cell % 3 - 1
            other = frame.near_node[bucket_of(frame.near_node, column, rank)].first
            while other >= 0:
                near = frame.node[other]
                if other < v and near.column == column and near.rank == rank and _is_close(near, node, least):
                    _note(hits, other, v, -1, -1)
                other = near.following
            k = frame.near_bar[bucket_of(frame.near_bar, column, rank)].first
            while k >= 0:
                bar = frame.bar[k]
                if bar.column == column and bar.rank == rank and _is_beside(v, node, bar, least):
                    _note(hits, v, -1, bar.owner, -1)
                k = bar.following


@jit
def find_sharp(frame: Frame, least: Clearances, hits: Hits) -> None:
    """Note the pairs of roads that meet at an angle whose cosine is not below the least.

    Norm: docs/rules.md#arms.
    """
    for gap in range(1, 4):
        for k in range(frame.arm.shape[0] - gap):
            arm, other = frame.arm[k], frame.arm[k + gap]
            if arm.hub == other.hub and arm.dx * other.dx + arm.dy * other.dy > least.cosine - ROUNDING:
                _note(hits, arm.hub, -1, arm.segment, other.segment)


@jit
def put_arms(frame: Frame) -> None:
    """Put the roads out of intersections in order: by these, first those that begin there; pieces are whole roads."""
    count = frame.bar.shape[0]
    for v in range(frame.place.shape[0]):
        frame.place[v] = 0
    for k in range(count):
        frame.place[frame.bar[k].a + 1] += 1
        frame.place[frame.bar[k].b + 1] += 1
    for v in range(1, frame.place.shape[0]):
        frame.place[v] += frame.place[v - 1]
    for k in range(2 * count):
        bar = frame.bar[k if k < count else k - count]
        hub = bar.a if k < count else bar.b
        arm = frame.arm[int(frame.place[hub])]
        frame.place[hub] += 1
        arm.hub = hub
        arm.segment = k if k < count else k - count
        dx = bar.x1 - bar.x0 if k < count else bar.x0 - bar.x1
        dy = bar.y1 - bar.y0 if k < count else bar.y0 - bar.y1
        far = norm(dx, dy)
        arm.dx = dx / far
        arm.dy = dy / far


@jit
def find_meetings(frame: Frame, hits: Hits) -> None:
    """Note the pairs of segments of the lattice that meet elsewhere than at a common end; exact, in integers."""
    _file(frame, 0.0)
    for s in range(frame.bar.shape[0]):
        bar = frame.bar[s]
        for cell in range(9):
            column = bar.column + cell // 3 - 1
            rank = bar.rank + cell % 3 - 1
            other = frame.near_bar[bucket_of(frame.near_bar, column, rank)].first
            while other >= 0:
                near = frame.bar[other]
                if other < s and near.column == column and near.rank == rank and _meet(near, bar):
                    _note(hits, -1, -1, other, s)
                other = near.following


@jit
def _file(frame: Frame, wide: float) -> None:
    """Put all into cells so wide that what is nearer than `wide` lies in cells beside one another."""
    longest = 0.0
    for k in range(frame.bar.shape[0]):
        bar = frame.bar[k]
        longest = max(longest, norm(bar.x1 - bar.x0, bar.y1 - bar.y0))
    side = (longest + wide) * WIDER
    empty(frame.near_node)
    empty(frame.near_bar)
    for v in range(frame.node.shape[0]):
        node = frame.node[v]
        node.column = floor(node.x / side)
        node.rank = floor(node.y / side)
        bucket = frame.near_node[bucket_of(frame.near_node, node.column, node.rank)]
        node.following = bucket.first
        bucket.first = v
    for k in range(frame.bar.shape[0]):
        bar = frame.bar[k]
        bar.column = floor(0.5 * (bar.x0 + bar.x1) / side)
        bar.rank = floor(0.5 * (bar.y0 + bar.y1) / side)
        bucket = frame.near_bar[bucket_of(frame.near_bar, bar.column, bar.rank)]
        bar.following = bucket.first
        bucket.first = k


@jit
def _is_close(one: Node, other: Node, least: Clearances) -> bool:
    """Return whether two intersections are too close."""
    return norm(one.x - other.x, one.y - other.y) < least.apart - ROUNDING


@jit
def _is_beside(v: int, node: Node, bar: Bar, least: Clearances) -> bool:
    """Return whether intersection v is too close to a piece of a road that does not end there."""
    if v in (bar.a, bar.b):
        return False
    dx = bar.x1 - bar.x0
    dy = bar.y1 - bar.y0
    rx = node.x - bar.x0
    ry = node.y - bar.y0
    along = (rx * dx + ry * dy) / (dx * dx + dy * dy)
    along = min(max(along, 0.0), 1.0)
    return norm(rx - along * dx, ry - along * dy) < least.aside - ROUNDING


@jit
def _meet(p: Bar, q: Bar) -> bool:
    """Return whether two segments of the lattice share a point other than one common end."""
    low_x = int(max(min(p.x0, p.x1), min(q.x0, q.x1)))
    high_x = int(min(max(p.x0, p.x1), max(q.x0, q.x1)))
    low_y = int(max(min(p.y0, p.y1), min(q.y0, q.y1)))
    high_y = int(min(max(p.y0, p.y1), max(q.y0, q.y1)))
    if low_x > high_x or low_y > high_y:
        return False
    first = _side(p, q.x0, q.y0)
    second = _side(p, q.x1, q.y1)
    begins = (q.x0 == p.x0 and q.y0 == p.y0) or (q.x0 == p.x1 and q.y0 == p.y1)
    ends = (q.x1 == p.x0 and q.y1 == p.y0) or (q.x1 == p.x1 and q.y1 == p.y1)
    if begins or ends:
        return first == 0 and second == 0 and (low_x < high_x or low_y < high_y)
    return first * second <= 0 and _side(q, p.x0, p.y0) * _side(q, p.x1, p.y1) <= 0


@jit
def _side(p: Bar, x: float, y: float) -> int:
    """Return on which side of a segment of the lattice a point of it lies: 1, 0 or -1."""
    turn = int(p.x1 - p.x0) * int(y - p.y0) - int(p.y1 - p.y0) * int(x - p.x0)
    return (1 if turn > 0 else 0) - (1 if turn < 0 else 0)
