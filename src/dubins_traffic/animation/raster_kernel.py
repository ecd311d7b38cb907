"""Cars and marks painted over a picture of the roads, pixel by pixel, with smooth edges."""

from __future__ import annotations

from math import ceil, floor, sqrt
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.compile import jit, jit_inline

Image = npt.NDArray[np.uint8]


class _Marks(NamedTuple):
    """Kinds of marks."""

    CONTACT: int = 0
    OWN: int = 1
    """A breach of the ego's."""
    OTHERS: int = 2
    """A breach of an e-agent's."""


class _Row(NamedTuple):
    """Rows of colours."""

    INK: int = 0
    WHITE: int = 1
    ACCENT: int = 2
    CONTACT_INK: int = 3
    """Those of breaches follow."""
    FIRST_TINT: int = 6
    """From here on, of the ego and the others in turn."""


MARKS: Final = _Marks()
ROW: Final = _Row()
RING_SECONDS: Final = 1.2
"""For how long a mark is young: a ring grows about it."""
HALF_ROOT: Final = 0.7071067811865476
MARK: Final = 4
"""Numbers of a mark: its place x and y, world frame, metres, its kind, and its age in seconds."""


class View(NamedTuple):
    """How the world lies in the picture, and how things are drawn; lengths in pixels."""

    scale: float
    """Pixels of a metre."""
    left: float
    """World coordinate x of the left edge, metres."""
    top: float
    """World coordinate y of the upper edge, metres."""
    half_length: float
    half_width: float
    rounding: float
    """The body is a box of these halves, rounded by so much all round; a disc is a rounded point."""
    edge: float
    """Half the width of the line round bodies."""
    mark: float
    """Size of marks."""
    stroke: float
    """By how much lines of marks and rings are thinner than in a large picture, 0 to 1."""
    chosen: int
    """Number of the car that has a ring about it, -1 for none."""
    colour: Floats
    """Red, green and blue, 0 to 255, of all that is painted, (rows, 3)."""


class Spot(NamedTuple):
    """A point of the picture: pixels from its left edge, and from above."""

    x: float
    y: float


@jit_inline
def _cover(distance: float) -> float:
    """Return which share of a pixel lies in a shape, whose edge is so far from the pixel's centre (inside: below 0)."""
    return min(1.0, max(0.0, 0.5 - distance))


@jit
def _blend(image: Image, row: int, column: int, view: View, which: int, share: float) -> None:
    """Mix a share of a colour into a pixel."""
    if share <= 0.0:
        return
    for k in range(3):
        old = float(image[row, column, k])
        image[row, column, k] = np.uint8(int(old + (view.colour[which, k] - old) * share + 0.5))


@jit
def _within(image: Image, spot: Spot, reach: float) -> tuple[int, int, int, int]:
    """Return the first row and the one behind the last, and columns, of pixels that are nearer to a spot, about."""
    return (
        max(0, floor(spot.y - reach)),
        min(image.shape[0], ceil(spot.y + reach)),
        max(0, floor(spot.x - reach)),
        min(image.shape[1], ceil(spot.x + reach)),
    )


@jit_inline
def _body(u: float, v: float, view: View) -> float:
    """Return how far a point, in the frame of a car, is from its body (inside: below 0)."""
    du = abs(u) - view.half_length
    dv = abs(v) - view.half_width
    out_u = max(du, 0.0)
    out_v = max(dv, 0.0)
    return sqrt(out_u * out_u + out_v * out_v) + min(max(du, dv), 0.0) - view.rounding


@jit
def _reach(view: View) -> float:
    """Return how far a body reaches from its centre."""
    return sqrt(view.half_length * view.half_length + view.half_width * view.half_width) + view.rounding


@jit
def _car(image: Image, spot: Spot, c: float, s: float, which: int, view: View) -> None:
    """Paint a body with its line round it, and on it the arrow head that says where it goes."""
    top, bottom, left, right = _within(image, spot, _reach(view) + view.edge + 1.0)
    long, wide = view.half_length + view.rounding, view.half_width + view.rounding
    tip, base, side = 0.86 * long, 0.12 * long, 0.56 * wide
    slant = sqrt((tip - base) * (tip - base) + side * side)
    for row in range(top, bottom):
        for column in range(left, right):
            dx = column + 0.5 - spot.x
            dy = row + 0.5 - spot.y
            u = dx * c - dy * s
            v = dx * s + dy * c
            distance = _body(u, v, view)
            _blend(image, row, column, view, ROW.INK, _cover(distance - view.edge))
            _blend(image, row, column, view, which, _cover(distance + view.edge))
            flank = (side * (u - tip) + (tip - base) * abs(v)) / slant
            _blend(image, row, column, view, ROW.WHITE, _cover(max(flank, base - u)))


@jit
def _ring(image: Image, spot: Spot, radius: float, half: float, which: int, view: View, share: float) -> None:
    """Paint a ring of `radius` and half the width `half`."""
    top, bottom, left, right = _within(image, spot, radius + half + 1.0)
    for row in range(top, bottom):
        for column in range(left, right):
            dx = column + 0.5 - spot.x
            dy = row + 0.5 - spot.y
            away = abs(sqrt(dx * dx + dy * dy) - radius) - half
            _blend(image, row, column, view, which, share * _cover(away))


@jit
def _cross(image: Image, spot: Spot, view: View) -> None:
    """Paint the cross of a contact, with a halo."""
    arm = 0.75 * view.mark
    top, bottom, left, right = _within(image, spot, arm + 3.5)
    for row in range(top, bottom):
        for column in range(left, right):
            dx = column + 0.5 - spot.x
            dy = row + 0.5 - spot.y
            u, v = abs(dx + dy) * HALF_ROOT, abs(dx - dy) * HALF_ROOT
            beyond = max(max(u, v) - 2.0 * HALF_ROOT * arm, 0.0)
            near = min(u, v)
            away = sqrt(beyond * beyond + near * near)
            _blend(image, row, column, view, ROW.WHITE, _cover(away - 2.25 * view.stroke))
            _blend(image, row, column, view, ROW.CONTACT_INK, _cover(away - 1.2 * view.stroke))


@jit
def _triangle(image: Image, spot: Spot, kind: int, view: View) -> None:
    """Paint the triangle of a breach, with a halo; those of others than the ego are white within."""
    size = view.mark
    top, bottom, left, right = _within(image, spot, 1.3 * size + 5.0)
    slant = sqrt(1.6 * 1.6 + 0.9 * 0.9)
    for row in range(top, bottom):
        for column in range(left, right):
            dx = column + 0.5 - spot.x
            dy = row + 0.5 - spot.y
            flank = (1.6 * abs(dx) - 0.9 * (dy + size)) / slant
            away = max(flank, dy - 0.6 * size)
            _blend(image, row, column, view, ROW.WHITE, 0.9 * _cover(away - 2.5 * view.stroke))
            _blend(image, row, column, view, ROW.CONTACT_INK + kind, _cover(away - view.stroke))
            if kind != MARKS.OWN:
                _blend(image, row, column, view, ROW.WHITE, _cover(away + view.stroke))


@jit
def _mark(image: Image, number: int, marks: Floats, view: View) -> None:
    """Paint a mark, and the ring about it while it is young."""
    spot = Spot((marks[number, 0] - view.left) * view.scale, (view.top - marks[number, 1]) * view.scale)
    kind = int(marks[number, 2])
    if kind == MARKS.CONTACT:
        _cross(image, spot, view)
    else:
        _triangle(image, spot, kind, view)
    age = marks[number, 3] / RING_SECONDS
    if 0.0 <= age < 1.0:
        radius = (1.5 + 1.5 * age) * 1.6 * view.mark
        _ring(image, spot, radius, 1.5 * view.stroke, ROW.CONTACT_INK + kind, view, 1.0 - age)


@jit
def paint(image: Image, x: Floats, y: Floats, c: Floats, s: Floats, marks: Floats, view: View) -> None:
    """Paint marks and cars over a picture of the roads, in place; the first car comes last, on top.

    Parameters
    ----------
    image : (H, W, 3) uint8
        The picture.
    x, y, c, s : (N,)
        Poses of the cars, world frame, metres, and cosines and sines of their headings.
    marks : (M, MARK)
        What has been broken, and touched.
    view
        How the world lies in the picture.
    """
    for number in range(marks.shape[0]):
        _mark(image, number, marks, view)
    others = view.colour.shape[0] - ROW.FIRST_TINT - 1
    for k in range(x.shape[0]):
        car = x.shape[0] - 1 - k
        spot = Spot(float((x[car] - view.left) * view.scale), float((view.top - y[car]) * view.scale))
        if car == view.chosen:
            _ring(image, spot, _reach(view) + 0.75 * view.mark, 0.8 * view.stroke, ROW.ACCENT, view, 1.0)
        which = ROW.FIRST_TINT if car == 0 else ROW.FIRST_TINT + 1 + (car - 1) % others
        _car(image, spot, float(c[car]), float(s[car]), which, view)
