"""A line of any kind as a control polygon whose corners are rounded by tangent arcs, within a tolerance.

Dense points of a clothoid or a cubic are fitted as a polyline is: corners on the line (Douglas and Peucker), radii as
large as the legs let them be, then pairs of corners drawn together to one as long as the tolerance is kept. Two
neighbouring arcs that share the whole leg between them are a biarc.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.maps.model import Corner
from dubins_traffic.maps.polylines import (
    along,
    arc,
    cleaned,
    dense,
    nearest,
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
FAR = 60.0
"""Both ends of a line that is longer than so many of its straight ends are fitted one after the other."""
LARGEST_RADIUS = 1e5
ON_LINE = 0.7
"""An arc leaves its corner by at least this share of the tolerance."""
COLLINEAR = 1e-7
"""Corners with a smaller tangent of half their turn are none."""
SAGITTA = 0.02
"""Chords stand for an arc that leaves them by at most this share of the tolerance."""
REACH_OF_A_MERGE = 4
"""Where two corners become one, it can be another matter whether so many corners before them should."""


class Trace(NamedTuple):
    """A curve of parts, and how near some points are to it.

    Attributes
    ----------
    points : array (N, 2)
        The points, in the order of their line.
    parts : sequence of array (M, 2)
        Points of the curve, part after part; none is empty.
    away : array (N,)
        The distance of each point to the curve.
    owner : array (N,)
        The part in which the side of the curve begins that is nearest to the point.
    """

    points: Floats
    parts: Sequence[Floats]
    away: Floats
    owner: Ints

    def exchanged(self, begin: int, end: int, new: Sequence[Floats]) -> Trace:
        """Return this with the parts from `begin` to before `end` exchanged for `new`.

        Points that were nearest to other parts are reckoned as far as before: they may be nearer to the new ones.
        """
        low = max(begin - 1, 0)
        touched = np.flatnonzero((self.owner >= low) & (self.owner < end))
        parts = [*self.parts[:begin], *new, *self.parts[end:]]
        local = [*self.parts[low:begin], *new, *(part[:1] for part in self.parts[end : end + 1])]
        away = self.away.copy()
        owner = np.where(self.owner >= end, self.owner + (len(new) - (end - begin)), self.owner)
        if len(touched):
            away[touched], nearest = _measured(self.points[touched], local)
            owner[touched] = low + nearest
        return Trace(self.points, parts, away, owner)


def traced(points: Floats, parts: Sequence[Floats]) -> Trace:
    """Return how near points (N, 2) are to a curve of two points or more."""
    return Trace(points, parts, *_measured(points, parts))


def _measured(points: Floats, parts: Sequence[Floats]) -> tuple[Floats, Ints]:
    away, side = nearest(points, np.concatenate(parts))
    return away, np.repeat(np.arange(len(parts)), [len(part) for part in parts])[side]


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


Approach = tuple[Floats, float]
"""Corners with which a fit may begin, and how far along the line the rest begins."""
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
    fixed = aims[0] is not None, aims[1] is not None
    best = None if any(fixed) else _fitted(line[[0, -1]], fixed, samples, length, limits)
    heads, tails = (list(_approaches(one, limits, aim)) for one, aim in zip((line, line[::-1]), aims, strict=True))
    far = length > FAR * limits.straight
    chosen = heads[0]
    for head, tail in [(head, tail) for head in heads for tail in (tails[:1] if far else tails)]:
        if best is None or best.lost > 0.0:
            made = _begun(line, head, tail, fixed, samples, limits)
            if made is not None and (best is None or made.cost < best.cost):
                best, chosen = made, head
    for tail in tails[1:] if far else []:
        if best is None or best.lost > 0.0:
            made = _begun(line, chosen, tail, fixed, samples, limits)
            best = min((each for each in (best, made) if each is not None), key=lambda each: each.cost, default=None)
    return best


def _begun(
    line: Floats, head: Approach, tail: Approach, fixed: tuple[bool, bool], samples: Floats, limits: Limits
) -> Fit | None:
    """Return the fit of a line that begins and ends so, None if there is none."""
    length = float(along(line)[-1])
    parts = [line[:1], head[0], tail[0][::-1], line[-1:]]
    if head[1] + tail[1] < length:
        middle = stretch(line, head[1], length - tail[1])
        parts.insert(2, simplified(middle, 0.5 * limits.tolerance))
    elif not any(fixed):
        return None
    return _fitted(cleaned(np.concatenate(parts)), fixed, samples, length, limits)


def _approaches(line: Floats, limits: Limits, aim: Aim) -> Iterator[Approach]:
    """Yield corners with which a fit may begin, and how far along the line the rest begins."""
    straight = limits.straight
    if aim is None:
        yield from ((np.empty((0, 2)), reach * straight) for reach in REACHES)
        return
    for reach in REACHES:
        far = reach * straight
        corner = (line[0] + far * np.array(aim))[None]
        yield from ((corner, far + rejoin * straight) for rejoin in REJOINS)


def _fitted(polygon: Floats, fixed: tuple[bool, bool], samples: Floats, length: float, limits: Limits) -> Fit | None:
    """Return the fit of a control polygon: made feasible, then with fewer corners."""
    feasible = _feasible(polygon, fixed, samples, limits)
    if feasible is None:
        return None
    polygon, radii = _drawn_together(*feasible, fixed, samples, length, limits)
    corners = tuple((float(x), float(y), float(r)) for (x, y), r in zip(polygon[1:-1], radii, strict=True))
    return judged(polygon[0], corners, polygon[-1], samples, length, limits)


def _drawn_together(
    polygon: Floats, away: Floats, fixed: tuple[bool, bool], samples: Floats, length: float, limits: Limits
) -> tuple[Floats, Floats]:
    """Return a feasible polygon and its radii with fewer corners: two become one as long as nothing more is lost.

    `away` is how far each point of the polygon is from the samples.
    """
    radii = radii_of(polygon, away, limits)
    assert radii is not None
    trace = traced(samples, _arcs(polygon, radii, 0, len(polygon), limits))
    lost = _lost(trace, length, limits)
    low = each = 1 + fixed[0]
    while each <= len(polygon) - 3 - fixed[1]:
        for exchange in _merges(polygon, fixed, each, each):
            option, beside = exchange.of(polygon), exchange.of(away, to_segments(exchange.points, samples))
            wide = radii_of(option, beside, limits)
            if wide is None or (wide < limits.radius).any():
                continue
            tried = trace.exchanged(each - 1, each + 3, _arcs(option, wide, each - 1, each + 2, limits))
            if round(_lost(tried, length, limits), 3) <= round(lost, 3):
                polygon, away, radii, trace = option, beside, wide, tried
                lost = _lost(trace, length, limits)
                each = max(low, each - REACH_OF_A_MERGE) - 1
        each += 1
    return polygon, radii


def _arcs(polygon: Floats, radii: Floats, begin: int, end: int, limits: Limits) -> list[Floats]:
    """Return the arcs that round the corners from `begin` to before `end`; an end of the polygon is a point."""
    parts: list[Floats] = []
    for k in range(begin, end):
        if 0 < k < len(polygon) - 1:
            before, corner, after = polygon[k - 1], polygon[k], polygon[k + 1]
            parts.append(arc(before, corner, after, float(radii[k - 1]), SAGITTA * limits.tolerance))
        else:
            parts.append(polygon[k : k + 1])
    return parts


def _lost(trace: Trace, length: float, limits: Limits) -> float:
    return length * float((trace.away > limits.tolerance).mean())


def _feasible(
    polygon: Floats, fixed: tuple[bool, bool], samples: Floats, limits: Limits
) -> tuple[Floats, Floats] | None:
    """Return the polygon without the corners that leave no room for the least radius, and how far from the samples
    each of its points is.
    """
    away = to_segments(polygon, samples)
    trace: Trace | None = None
    while True:
        keep = _bends(polygon, fixed)
        if not keep.all():
            polygon, away, trace = polygon[keep], away[keep], None
        radii = radii_of(polygon, away, limits)
        if radii is None:
            return None
        tight = np.flatnonzero(radii < limits.radius)
        if not len(tight):
            return polygon, away
        k = int(tight[np.argmin(radii[tight])]) + 1
        options = [*_drops(polygon, fixed, k), *_merges(polygon, fixed, k - 1, k)]
        if not options:
            return None
        trace = trace or traced(samples, list(polygon[:, None]))
        tried = [trace.exchanged(each.begin, each.end, list(each.points[:, None])) for each in options]
        best = min(range(len(options)), key=lambda each: float(tried[each].away.max()))
        trace, taken = tried[best], options[best]
        polygon, away = taken.of(polygon), taken.of(away, to_segments(taken.points, samples))


def radii_of(polygon: Floats, away: Floats, limits: Limits) -> Floats | None:
    """Return the radii (N - 2,) that fit between the legs of a polygon, None where its ends can't be straight.

    A corner that is `away` (N,) from the line is rounded so that the arc meets it, one on the line by less than the
    tolerance.
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
    beside = np.maximum(away[1:-1], ON_LINE * limits.tolerance)
    off = beside / np.maximum(np.sqrt(1.0 + inner * inner) - 1.0, 1e-300)
    wanted = np.minimum(np.maximum(off, limits.radius), LARGEST_RADIUS)
    return np.minimum(np.minimum(room[:-1], room[1:]), wanted)


def judged(
    start: Floats, corners: tuple[Corner, ...], end: Floats, samples: Floats, length: float, limits: Limits
) -> Fit:
    """Return corners as a fit of the line of which `samples` (N, 2) are points at equal distances."""
    curve = rounded(start, corners, end, SAGITTA * limits.tolerance)
    away = to_segments(samples, curve)
    return Fit(corners, length * float((away > limits.tolerance).mean()), float(away.max()))


def _bends(polygon: Floats, fixed: tuple[bool, bool]) -> npt.NDArray[np.bool_]:
    """Return which points of a polygon are its ends, corners at which it turns, or must stay where they are."""
    if len(polygon) < 3:
        return np.ones(len(polygon), dtype=np.bool_)
    keep = np.concatenate([[True], turns(polygon) > COLLINEAR, [True]])
    keep[1] |= fixed[0]
    keep[-2] |= fixed[1]
    return keep


class Exchange(NamedTuple):
    """Points that a polygon is to have instead of those from `begin` to before `end`."""

    begin: int
    end: int
    points: Floats

    def of(self, rows: Floats, new: Floats | None = None) -> Floats:
        """Return the rows, one a point of the polygon, with `new` ones, by default the points themselves."""
        return np.concatenate([rows[: self.begin], self.points if new is None else new, rows[self.end :]])


def _drops(polygon: Floats, fixed: tuple[bool, bool], k: int) -> list[Exchange]:
    """Return how one of the corners about corner `k` goes."""
    low, high = 1 + fixed[0], len(polygon) - 2 - fixed[1]
    return [Exchange(each, each + 1, np.empty((0, 2))) for each in range(max(k - 1, low), min(k + 1, high) + 1)]


def _merges(polygon: Floats, fixed: tuple[bool, bool], begin: int, end: int) -> list[Exchange]:
    """Return how a corner from `begin` to `end` and the next become one, where the outer legs meet."""
    low, high = max(1 + fixed[0], begin), min(len(polygon) - 3 - fixed[1], end)
    made = [(each, _meeting(polygon[each - 1 : each + 3])) for each in range(low, high + 1)]
    return [Exchange(each, each + 2, corner[None]) for each, corner in made if corner is not None]


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
    return rounded(start, fitted.corners, end, SAGITTA * limits.tolerance)
