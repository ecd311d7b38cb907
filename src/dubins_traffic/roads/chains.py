"""Roads that bend: polygons whose corners are rounded by arcs tangent to both sides, as chains of pieces.

`Chains` has those of a network in the world, and tells in NumPy where points lie along them; `roads.lookup` says the
same for kernels, bit for bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import ceil, sqrt
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.angles import angle, sincos
from dubins_traffic.kernels.arrays import Floats, Ints

Point = tuple[float, float]
Segment = tuple[float, float, float, float]
"""Ends x0, y0, x1, y1, lattice units; whole numbers are integers."""
Corner = tuple[float, float, float]
"""x, y and the radius of the arc that rounds it, lattice units."""
Corners = tuple[Corner, ...]
"""The corners of a segment that bends."""
TIGHT = 1e-9
"""Tangents may overlap by this share of the side; a line of less is left out."""
STRAIGHT = 1e-12
"""Sine of a corner below which it has no arc."""
FINEST = 64
"""An arc is never drawn with more chords."""


class ChainPiece(NamedTuple):
    """A line or an arc of a chain, in the units of its polygon.

    Attributes
    ----------
    x, y, tx, ty : float
        Where it begins, and the unit vector along the chain there.
    length : float
        Its length.
    cx, cy, radius : float
        Centre and radius of an arc; 0 for a line.
    side : float
        1 where the chain turns left, -1 where it turns right, 0 for a line.
    end_x, end_y, end_tx, end_ty : float
        Where it ends, and the unit vector along the chain there.
    """

    x: float
    y: float
    tx: float
    ty: float
    length: float
    cx: float
    cy: float
    radius: float
    side: float
    end_x: float
    end_y: float
    end_tx: float
    end_ty: float


class _Bow(NamedTuple):
    """How a corner is rounded: the tangents' length, the turn's sine and cosine."""

    tangent: float
    sine: float
    cosine: float


def chain(start: Point, corners: Sequence[Corner], end: Point) -> tuple[ChainPiece, ...]:
    """Return the pieces of the polygon from `start` over the `corners` to `end`.

    Raises
    ------
    InputError
        If two points are one, a corner turns back, tangents overlap, or no line is left at an end: it begins with the
        corner.
    """
    points = [start, *((x, y) for x, y, _ in corners), end]
    sides = [_side(k, p, q) for k, (p, q) in enumerate(pairwise(points))]
    bows = [_bow(k, corner[2], *sides[k][:2], *sides[k + 1][:2]) for k, corner in enumerate(corners)]
    pieces: list[ChainPiece] = []
    for k, (ux, uy, length) in enumerate(sides):
        before = bows[k - 1].tangent if k else 0.0
        after = bows[k].tangent if k < len(bows) else 0.0
        left = length - before - after
        at_end = k in (0, len(bows))
        if left < -TIGHT * length or (at_end and left <= TIGHT * length):
            raise _overlap(k, len(bows), before + after, length)
        (x0, y0), (x1, y1) = points[k], points[k + 1]
        x0, y0, x1, y1 = x0 + before * ux, y0 + before * uy, x1 - after * ux, y1 - after * uy
        if left > TIGHT * length:
            pieces.append(ChainPiece(x0, y0, ux, uy, left, 0.0, 0.0, 0.0, 0.0, x1, y1, ux, uy))
        if after > 0.0:
            vx, vy = sides[k + 1][:2]
            corner = points[k + 1]
            stop = corner[0] + after * vx, corner[1] + after * vy
            pieces.append(_arc((x1, y1), (ux, uy), stop, (vx, vy), corners[k][2], bows[k]))
    return tuple(pieces)


def _side(k: int, p: Point, q: Point) -> tuple[float, float, float]:
    """Return direction and length of a side of the polygon."""
    dx, dy = q[0] - p[0], q[1] - p[1]
    norm = sqrt(dx * dx + dy * dy)
    if norm == 0.0:
        raise InputError(f"corner {max(k - 1, 0)}: lies on the point next to it", expected="points apart")
    return dx / norm, dy / norm, norm


def _bow(k: int, radius: float, ux: float, uy: float, vx: float, vy: float) -> _Bow:
    """Return how corner k, from direction u to direction v, is rounded."""
    sine, cosine = ux * vy - uy * vx, ux * vx + uy * vy
    if abs(sine) < STRAIGHT and cosine > 0.0:
        return _Bow(0.0, 0.0, 1.0)
    if 1.0 + cosine < TIGHT:
        raise InputError(f"corner {k}: turns straight back", expected="a turn of less than 180 degrees")
    return _Bow(radius * abs(sine) / (1.0 + cosine), sine, cosine)


def _arc(start: Point, u: Point, stop: Point, v: Point, radius: float, bow: _Bow) -> ChainPiece:
    side = 1.0 if bow.sine > 0.0 else -1.0
    cx, cy = start[0] - side * radius * u[1], start[1] + side * radius * u[0]
    length = radius * angle(abs(bow.sine), bow.cosine)
    return ChainPiece(*start, *u, length, cx, cy, radius, side, *stop, *v)


def _overlap(k: int, count: int, needed: float, length: float) -> InputError:
    """Return the fault of side k, whose arcs need more than there is."""
    names = [str(j) for j in (k - 1, k) if 0 <= j < count]
    which = f"corner {names[0]}" if len(names) == 1 else f"corners {names[0]} and {names[1]}"
    at_end = len(names) == 1
    return InputError(
        f"{which}: the arc does not fit" if at_end else f"{which}: the arcs overlap",
        value=round(needed, 9),
        expected=f"tangents of {'less than' if at_end else 'at most'} {length:.9g} in all on that side",
    )


class Bars(NamedTuple):
    """Straight bars in the place of segments: the segment of each (K,), and its ends (K, 2)."""

    owner: Ints
    start: Floats
    end: Floats


class Runs(NamedTuple):
    """A straight run of each segment: its ends and the unit vector along it (S, 2), its length (S,)."""

    start: Floats
    end: Floats
    tangent: Floats
    length: Floats


class Chains:
    """The pieces of the segments that bend, one segment after another; a straight segment has none.

    Parameters
    ----------
    segments, corners
        As of `RoadNetwork`.
    unit : float
        Metres of a lattice unit.
    transform : (float, float, float)
        As of `RoadNetwork`.

    Attributes
    ----------
    first : (S + 1,) int64
        First piece of each segment.
    owner : (P,) int64
        Segment of each piece.
    start, tangent, end, end_tangent, centre : (P, 2) float64
        Where a piece begins and ends, the unit vectors along the chain there, the centre of an arc; world, metres.
    length, base, rest, radius, side : (P,) float64
        Its length, that of the chain before it and of the chain from where it begins, metres; radius of an arc, 1
        where it turns left, -1 right; a line has 0 for both.
    lengths : (S,) float64
        Lengths of the chains, 0 for straight segments.
    """

    def __init__(
        self,
        segments: Sequence[Segment],
        corners: Sequence[Sequence[Corner]],
        unit: float,
        transform: tuple[float, float, float],
    ) -> None:
        given = pieces(segments, corners)
        self.first: Ints = np.concatenate([[0], np.cumsum([len(pieces) for pieces in given])]).astype(np.int64)
        self.owner: Ints = np.repeat(np.arange(len(given)), np.diff(self.first))
        rows = np.array([piece for pieces in given for piece in pieces], dtype=np.float64)
        rows = rows.reshape(-1, len(ChainPiece._fields))
        tx, ty, theta = transform
        turn, shift = sincos(theta), np.array([tx, ty])
        self.start = turned(unit * rows[:, 0:2], *turn) + shift
        self.tangent = turned(rows[:, 2:4], *turn)
        self.centre = turned(unit * rows[:, 5:7], *turn) + shift
        self.end = turned(unit * rows[:, 9:11], *turn) + shift
        self.end_tangent = turned(rows[:, 11:13], *turn)
        self.length: Floats = unit * rows[:, 4]
        self.radius: Floats = unit * rows[:, 7]
        self.side: Floats = rows[:, 8].copy()
        self.base = np.zeros(len(rows))
        self.lengths = np.zeros(len(given))
        for k, s in enumerate(self.owner.tolist()):
            self.base[k] = self.lengths[s]
            self.lengths[s] += self.length[k]
        self.rest = self.lengths[self.owner] - self.base

    def bends(self, s: Ints | int) -> npt.NDArray[np.bool_]:
        """Whether segments bend."""
        return self.first[s] < self.first[np.add(s, 1)]

    def bars(self, start: Floats, end: Floats, sagitta: float) -> Bars:
        """Return bars for all segments, the straight ones from `start` to `end` (S, 2); see `RoadNetwork.bars`."""
        straight = np.flatnonzero(~self.bends(np.arange(len(start))))
        owner, begins, stops = [straight], [start[straight]], [end[straight]]
        for s in np.unique(self.owner).tolist():
            line, _ = self.places(s, self.marks(s, sagitta))
            owner.append(np.full(len(line) - 1, s))
            begins.append(line[:-1])
            stops.append(line[1:])
        return Bars(np.concatenate(owner), np.concatenate(begins), np.concatenate(stops))

    def runs(self, straight: Runs) -> Runs:
        """Return the longest line of each segment; `straight` has those of the segments that do not bend."""
        start, end, tangent, length = (each.copy() for each in straight)
        for s in np.unique(self.owner).tolist():
            pieces = np.arange(int(self.first[s]), int(self.first[s + 1]))
            k = pieces[np.argmax(np.where(self.side[pieces] == 0.0, self.length[pieces], 0.0))]
            start[s], end[s], tangent[s], length[s] = (
                self.start[k],
                self.end[k],
                self.tangent[k],
                self.length[k],
            )
        return Runs(start, end, tangent, length)

    def places(self, s: int, along: Floats) -> tuple[Floats, Floats]:
        """Return points (N, 2) of chain s and the unit vectors (N, 2) along it, so many metres from its start."""
        pieces: Ints = np.arange(int(self.first[s]), int(self.first[s + 1]))
        k: Ints = pieces[np.clip(np.searchsorted(self.base[pieces], along, side="right") - 1, 0, len(pieces) - 1)]
        gone = along - self.base[k]
        tangent, side, radius = self.tangent[k], self.side[k], self.radius[k]
        bent = side != 0.0
        turn = np.divide(gone, radius, out=np.zeros_like(gone), where=bent)
        c, s1 = (np.array(each) for each in zip(*(sincos(one) for one in turn.tolist()), strict=True))
        forth = np.where(bent, radius * s1, gone)
        aside = side * radius * (1.0 - c)
        left = np.stack([-tangent[:, 1], tangent[:, 0]], axis=-1)
        point = self.start[k] + forth[:, None] * tangent + aside[:, None] * left
        return point, c[:, None] * tangent + (side * s1)[:, None] * left

    def marks(self, s: int, sagitta: float) -> Floats:
        """Return how far along chain s the corners of a line drawn along it stand, ends included, metres.

        Between them it leaves the chain by at most `sagitta` metres (unless an arc needs more than `FINEST` chords).
        """
        marks = [0.0]
        for k in range(int(self.first[s]), int(self.first[s + 1])):
            count = self._chords(k, sagitta)
            marks += [float(self.base[k] + (j + 1) * self.length[k] / count) for j in range(count)]
        return np.array(marks)

    def _chords(self, k: int, sagitta: float) -> int:
        """Return how many chords stand for piece k."""
        if self.side[k] == 0.0:
            return 1
        return max(1, min(FINEST, ceil(self.length[k] / sqrt(8.0 * self.radius[k] * sagitta))))


def pieces(segments: Sequence[Segment], corners: Sequence[Sequence[Corner]]) -> list[tuple[ChainPiece, ...]]:
    """Return the pieces of each segment that bends, none for the others; an InputError names segment and corner."""
    of_segments: list[tuple[ChainPiece, ...]] = []
    for s, (x0, y0, x1, y1) in enumerate(segments):
        bends = corners[s] if corners else ()
        try:
            of_segments.append(chain((x0, y0), bends, (x1, y1)) if bends else ())
        except InputError as error:
            raise error.within(field=f"segments[{s}]") from None
    return of_segments


def sides(segments: Sequence[Segment], corners: Sequence[Sequence[Corner]]) -> list[Segment]:
    """Return the first and the last side of each segment's polygon: (dx, dy, dx, dy)."""
    chords: list[Segment] = []
    for s, (x0, y0, x1, y1) in enumerate(segments):
        bends = corners[s] if corners else ()
        (ax, ay), (bx, by) = (bends[0][:2], bends[-1][:2]) if bends else ((x1, y1), (x0, y0))
        chords.append((ax - x0, ay - y0, x1 - bx, y1 - by))
    return chords


def turned(vectors: Floats, c: float, s: float) -> Floats:
    """Return vectors (..., 2) turned by the angle whose cosine and sine are given."""
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)
