"""A road that bends: a polygon whose corners are rounded by arcs tangent to both sides, as a chain of pieces."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import sqrt
from typing import NamedTuple

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.angles import angle

Point = tuple[float, float]
Corner = tuple[float, float, float]
"""x, y and the radius of the arc that rounds it, lattice units."""

TIGHT = 1e-9
"""Tangents may overlap by this share of the side; a line of less is left out."""
STRAIGHT = 1e-12
"""Sine of a corner below which it has no arc."""


class Piece(NamedTuple):
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


def chain(start: Point, corners: Sequence[Corner], end: Point) -> tuple[Piece, ...]:
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
    pieces: list[Piece] = []
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
            pieces.append(Piece(x0, y0, ux, uy, left, 0.0, 0.0, 0.0, 0.0, x1, y1, ux, uy))
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


def _arc(start: Point, u: Point, stop: Point, v: Point, radius: float, bow: _Bow) -> Piece:
    side = 1.0 if bow.sine > 0.0 else -1.0
    cx, cy = start[0] - side * radius * u[1], start[1] + side * radius * u[0]
    length = radius * angle(abs(bow.sine), bow.cosine)
    return Piece(*start, *u, length, cx, cy, radius, side, *stop, *v)


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
