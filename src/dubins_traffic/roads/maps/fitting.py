"""A line of any kind as a control polygon whose corners are rounded by tangent arcs, within a tolerance.

Dense points of a clothoid or a cubic are fitted as a polyline is: corners on the line (Douglas and Peucker), radii as
large as the legs let them be, then pairs of corners drawn together to one as long as the tolerance is kept. Two
neighbouring arcs that share the whole leg between them are a biarc.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.roads.maps.model import Corner
from dubins_traffic.roads.maps.polylines import (
    along,
    at,
    cleaned,
    dense,
    rounded,
    simplified,
    stretch,
    to_segments,
    turns,
)

REACHES = (1.05, 1.4, 1.9)
"""Where the line may be joined again after the straight beginning, in lengths of that."""
REJOINS = (0.5, 1.0, 1.6)
"""The same after a beginning in a given direction, beyond it."""
LARGEST_RADIUS = 1e5
ON_LINE = 0.7
"""An arc leaves its corner by at least this share of the tolerance."""
COLLINEAR = 1e-7
"""Corners with a smaller tangent of half their turn are none."""


class Limits(NamedTuple):
    """What a fit must keep, metres.

    Attributes
    ----------
    tolerance : float
        How far the fit may be from the line where the line counts as kept.
    radius : float
        Least radius of an arc.
    straight : float
        How long the fit is straight at both ends.
    """

    tolerance: float
    radius: float
    straight: float


class Fit(NamedTuple):
    """A control polygon and how well it fits.

    Attributes
    ----------
    corners : tuple of (x, y, radius)
        Between both ends.
    lost : float
        Metres of the line that are farther from the fit than the tolerance.
    worst : float
        Largest distance of the line from the fit, metres.
    """

    corners: tuple[Corner, ...]
    lost: float
    worst: float

    @property
    def cost(self) -> tuple[float, int]:
        """What is to be small: what is lost, then the number of corners."""
        return round(self.lost, 3), len(self.corners)


Aim = tuple[float, float] | None
"""A direction (unit vector, away from the end) in which the fit leaves an end, None where it may choose."""


def fit(line: Floats, limits: Limits, aims: tuple[Aim, Aim] = (None, None)) -> Fit | None:
    """Return the best fit found of a line, None if there is none with these limits.

    Parameters
    ----------
    line : array (N, 2)
        Points of the line, from end to end; the fit has the same ends.
    limits : Limits
        Tolerance, least radius, straight ends.
    aims : pair
        Directions away from the first and from the last point.
    """
    line = cleaned(line)
    length = float(along(line)[-1])
    samples = dense(line, 5.0 * limits.tolerance)
    found: list[Fit] = []
    for polygon, fixed in _polygons(line, length, limits, aims):
        made = _fitted(polygon, fixed, samples, length, limits)
        if made is not None:
            found.append(made)
            if made.lost == 0.0:
                break
    return min(found, key=lambda each: each.cost) if found else None


def _polygons(
    line: Floats, length: float, limits: Limits, aims: tuple[Aim, Aim]
) -> Iterator[tuple[Floats, tuple[bool, bool]]]:
    """Yield control polygons to begin with, and whether their first and last corner must stay where they are."""
    fixed = aims[0] is not None, aims[1] is not None
    if not any(fixed):
        yield line[[0, -1]], fixed
    for head, joined in _approaches(line, limits, aims[0]):
        for tail, left in _approaches(line[::-1], limits, aims[1]):
            if joined + left < length:
                middle = simplified(stretch(line, joined, length - left), 0.5 * limits.tolerance)
                yield cleaned(np.concatenate([line[:1], head, middle, tail, line[-1:]])), fixed
            elif fixed[0] or fixed[1]:
                yield cleaned(np.concatenate([line[:1], head, tail, line[-1:]])), fixed


def _approaches(line: Floats, limits: Limits, aim: Aim) -> Iterator[tuple[Floats, float]]:
    """Yield corners with which a fit may begin, and how far along the line the rest begins."""
    straight = limits.straight
    if aim is None:
        yield from ((np.empty((0, 2)), reach * straight) for reach in REACHES)
        return
    for reach in REACHES:
        far = reach * straight
        corner = (line[0] + far * np.array(aim))[None]
        yield from ((corner, far + rejoin * straight) for rejoin in REJOINS)


def _fitted(
    polygon: Floats, fixed: tuple[bool, bool], samples: Floats, length: float, limits: Limits
) -> Fit | None:
    """Return the fit of a control polygon: made feasible, then with fewer corners."""
    feasible = _feasible(polygon, fixed, samples, limits)
    if feasible is None:
        return None
    best = _judged(feasible, samples, length, limits)
    changed = True
    while changed and best is not None:
        changed = False
        for option in _merged(feasible, fixed):
            tried = _judged(option, samples, length, limits)
            if tried is not None and tried.cost < best.cost:
                feasible, best, changed = option, tried, True
                break
    return best


def _feasible(polygon: Floats, fixed: tuple[bool, bool], samples: Floats, limits: Limits) -> Floats | None:
    """Return the polygon without the corners that leave no room for the least radius."""
    while True:
        polygon = _without_collinear(polygon, fixed)
        radii = radii_of(polygon, samples, limits)
        if radii is None:
            return None
        tight = np.flatnonzero(radii < limits.radius)
        if not len(tight):
            return polygon
        k = int(tight[np.argmin(radii[tight])]) + 1
        options = [*_dropped(polygon, fixed, k), *_merged(polygon, fixed, k)]
        if not options:
            return None
        polygon = min(options, key=lambda each: float(to_segments(samples, each).max()))


def radii_of(polygon: Floats, samples: Floats, limits: Limits) -> Floats | None:
    """Return the radii (N - 2,) that fit between the legs of a polygon, None where its ends can't be straight.

    A corner beside the line is rounded so that the arc meets it, one on the line by less than the tolerance.
    """
    step = np.diff(polygon, axis=0)
    legs = np.sqrt((step * step).sum(axis=1))
    if len(legs) == 1:
        return np.empty(0) if legs[0] >= 2.0 * limits.straight else None
    legs[[0, -1]] -= limits.straight
    if min(legs[0], legs[-1]) <= 0.0:
        return None
    half = np.concatenate([[0.0], turns(polygon), [0.0]])
    room = legs / np.maximum(half[:-1] + half[1:], 1e-300)
    inner = half[1:-1]
    # An arc leaves its corner by r (sqrt(1 + tan^2) - 1).
    away = np.maximum(to_segments(polygon[1:-1], samples), ON_LINE * limits.tolerance)
    off = away / np.maximum(np.sqrt(1.0 + inner * inner) - 1.0, 1e-300)
    wanted = np.minimum(np.maximum(off, limits.radius), LARGEST_RADIUS)
    return np.minimum(np.minimum(room[:-1], room[1:]), wanted)


def _judged(polygon: Floats, samples: Floats, length: float, limits: Limits) -> Fit | None:
    radii = radii_of(polygon, samples, limits)
    if radii is None or (radii < limits.radius).any():
        return None
    corners = tuple((float(x), float(y), float(r)) for (x, y), r in zip(polygon[1:-1], radii, strict=True))
    return judged(polygon[0], corners, polygon[-1], samples, length, limits)


def judged(
    start: Floats, corners: tuple[Corner, ...], end: Floats, samples: Floats, length: float, limits: Limits
) -> Fit:
    """Return corners as a fit of the line of which `samples` (N, 2) are points at equal distances."""
    curve = rounded(start, corners, end, 0.02 * limits.tolerance)
    away = to_segments(samples, curve)
    return Fit(corners, length * float((away > limits.tolerance).mean()), float(away.max()))


def _without_collinear(polygon: Floats, fixed: tuple[bool, bool]) -> Floats:
    if len(polygon) < 3:
        return polygon
    keep = np.concatenate([[True], turns(polygon) > COLLINEAR, [True]])
    keep[1] |= fixed[0]
    keep[-2] |= fixed[1]
    return polygon[keep]


def _dropped(polygon: Floats, fixed: tuple[bool, bool], k: int) -> list[Floats]:
    """Return the polygon without one of the corners about corner `k`."""
    low, high = 1 + fixed[0], len(polygon) - 2 - fixed[1]
    return [np.delete(polygon, each, axis=0) for each in range(max(k - 1, low), min(k + 1, high) + 1)]


def _merged(polygon: Floats, fixed: tuple[bool, bool], k: int | None = None) -> list[Floats]:
    """Return the polygon with two neighbouring corners as one, where the outer legs meet; near corner `k` only."""
    low, high = 1 + fixed[0], len(polygon) - 3 - fixed[1]
    if k is not None:
        low, high = max(low, k - 1), min(high, k)
    made: list[Floats] = []
    for each in range(low, high + 1):
        corner = _meeting(polygon[each - 1 : each + 3])
        if corner is not None:
            made.append(np.concatenate([polygon[:each], corner[None], polygon[each + 2 :]]))
    return made


def _meeting(four: Floats) -> Floats | None:
    """Return where the outer legs of a polygon of four points meet beyond the inner leg, None if they do not."""
    a, b, c, d = four
    first, last, between = b - a, c - d, c - b
    cross = first[0] * last[1] - first[1] * last[0]
    if abs(cross) < 1e-9:
        return None
    far = (between[0] * last[1] - between[1] * last[0]) / cross
    back = (between[0] * first[1] - between[1] * first[0]) / cross
    return b + far * first if far > 0.0 and back > 0.0 else None


def line_of(start: Floats, fitted: Fit, end: Floats, limits: Limits) -> Floats:
    """Return points on a fit."""
    return rounded(start, fitted.corners, end, 0.02 * limits.tolerance)


def heading_at(line: Floats, metres: float) -> tuple[float, float]:
    """Return the unit vector from the first point of a line to that so many metres along it."""
    step = at(line, metres) - line[0]
    size = float(np.hypot(*step))
    return (float(step[0]) / size, float(step[1]) / size) if size > 0.0 else (1.0, 0.0)
