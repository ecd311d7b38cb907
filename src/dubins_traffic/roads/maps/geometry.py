"""Points on lines, arcs, clothoids and cubics, the pieces of which roads are made."""

from __future__ import annotations

from math import ceil, cos, sin, sqrt
from typing import NamedTuple

import numpy as np

from dubins_traffic.kernels.arrays import Floats

SAGITTA = 2e-3
"""Chords leave the curve by about this many metres."""
MOST = 4000
"""Most chords of one piece."""


class Placed(NamedTuple):
    """Where a piece begins: x, y, heading (radians), and its length, metres."""

    x: float
    y: float
    heading: float
    length: float


def straight(place: Placed) -> Floats:
    """Return both ends of a line."""
    return _moved(place, np.array([[0.0, 0.0], [place.length, 0.0]]))


def clothoid(place: Placed, begin: float, end: float) -> Floats:
    """Return points on a piece whose curvature changes evenly from `begin` to `end`; equal ones are an arc's."""
    count = _count(place.length, max(abs(begin), abs(end)))
    s = np.linspace(0.0, place.length, 2 * count + 1)
    turn = begin * s + 0.5 * (end - begin) * s * s / max(place.length, 1e-300)
    # Simpson's rule on each of `count` stretches.
    step = place.length / count
    steps = [
        step / 6.0 * (each[:-1:2] + 4.0 * each[1::2] + each[2::2]) for each in (np.cos(turn), np.sin(turn))
    ]
    points = np.concatenate([np.zeros((1, 2)), np.cumsum(np.stack(steps, axis=-1), axis=0)])
    return _moved(place, points)


def cubic(place: Placed, u: Floats, v: Floats, last: float) -> Floats:
    """Return points on (u(p), v(p)), p from 0 to `last`: cubics by their four coefficients, constant first."""
    p = np.linspace(0.0, last, 65)
    for _ in range(3):
        points = np.stack([_value(u, p), _value(v, p)], axis=-1)
        step = np.diff(points, axis=0)
        bent = np.abs(step[:-1, 0] * step[1:, 1] - step[:-1, 1] * step[1:, 0])
        off = 0.25 * bent / np.maximum(np.sqrt((step * step).sum(axis=1))[:-1], 1e-300)
        if float(off.max(initial=0.0)) <= SAGITTA or len(p) >= MOST:
            break
        p = np.linspace(0.0, last, 4 * (len(p) - 1) + 1)
    return _moved(place, np.stack([_value(u, p), _value(v, p)], axis=-1))


def cubic_over(place: Placed, v: Floats) -> Floats:
    """Return points on v(u), u from 0 until the piece is as long as it should be."""
    u = np.linspace(0.0, place.length, 513)
    points = np.stack([u, _value(v, u)], axis=-1)
    step = np.diff(points, axis=0)
    along = np.concatenate([[0.0], np.cumsum(np.sqrt((step * step).sum(axis=1)))])
    return cubic(place, np.array([0.0, 1.0, 0.0, 0.0]), v, float(np.interp(place.length, along, u)))


def _value(c: Floats, p: Floats) -> Floats:
    return c[0] + p * (c[1] + p * (c[2] + p * c[3]))


def _count(length: float, curvature: float) -> int:
    return min(MOST, max(16, ceil(length / sqrt(8.0 * SAGITTA / max(curvature, 1e-12)))))


def _moved(place: Placed, points: Floats) -> Floats:
    c, s = cos(place.heading), sin(place.heading)
    x, y = points[:, 0], points[:, 1]
    return np.stack([place.x + c * x - s * y, place.y + s * x + c * y], axis=-1)
