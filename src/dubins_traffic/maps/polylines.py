"""Polylines and control polygons: points along them, distances to them, and arcs that round corners."""

from __future__ import annotations

from math import acos, ceil, sqrt

import numpy as np

from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.maps.model import Corner

_FEW = 1 << 13
"""So many pairs of points and sides are measured at once, all of them."""
_RUN = 64
"""Points that are measured together otherwise."""


def along(line: Floats) -> Floats:
    """Return the metres from the beginning of a polyline to each of its points, (N,)."""
    step = np.diff(line, axis=0)
    return np.concatenate([[0.0], np.cumsum(np.sqrt((step * step).sum(axis=1)))])


def at(line: Floats, metres: Floats | float) -> Floats:
    """Return the points so many metres along a polyline."""
    where = along(line)
    return np.stack([np.interp(metres, where, line[:, k]) for k in (0, 1)], axis=-1)


def stretch(line: Floats, begin: float, end: float) -> Floats:
    """Return the part of a polyline between two distances along it."""
    where = along(line)
    inside = (where > begin + 1e-9) & (where < end - 1e-9)
    return np.concatenate([at(line, np.array([begin])), line[inside], at(line, np.array([end]))])


def dense(line: Floats, step: float) -> Floats:
    """Return points along a polyline at most `step` apart, (N, 2)."""
    total = float(along(line)[-1])
    return at(line, np.linspace(0.0, total, max(2, ceil(total / step) + 1)))


def cleaned(line: Floats, least: float = 1e-6) -> Floats:
    """Return a polyline without points that stand nearly where the one before does; its ends stay."""
    kept = [line[0]]
    for point in line[1:-1]:
        if float(np.abs(point - kept[-1]).max()) > least:
            kept.append(point)
    if len(kept) > 1 and float(np.abs(line[-1] - kept[-1]).max()) <= least:
        kept.pop()
    return np.array([*kept, line[-1]])


def simplified(line: Floats, tolerance: float) -> Floats:
    """Return a polyline of some of the points, within `tolerance` of all (Douglas and Peucker)."""
    keep = np.zeros(len(line), dtype=np.bool_)
    keep[[0, -1]] = True
    waiting = [(0, len(line) - 1)]
    while waiting:
        first, last = waiting.pop()
        if last - first < 2:
            continue
        away = to_segments(line[first + 1 : last], line[[first, last]])
        far = int(np.argmax(away))
        if away[far] > tolerance:
            middle = first + 1 + far
            keep[middle] = True
            waiting += [(first, middle), (middle, last)]
    return line[keep]


def to_segments(points: Floats, line: Floats) -> Floats:
    """Return the distance of each of some points (N, 2) to a polyline (M, 2)."""
    return nearest(points, line)[0]


def nearest(points: Floats, line: Floats) -> tuple[Floats, Ints]:
    """Return the distance of each of some points (N, 2) to a polyline (M, 2), and the number of its nearest side.

    Points are best in the order of a line: those that follow each other are measured together, to the sides alone
    that can be nearest to one of them.
    """
    a, step = line[:-1], np.diff(line, axis=0)
    square = np.maximum((step * step).sum(axis=1), 1e-300)
    away, side = np.empty(len(points)), np.empty(len(points), dtype=np.int64)
    few = len(points) * len(a) <= _FEW
    count = max(1, len(points)) if few else _RUN
    for k in range(0, len(points), count):
        run = points[k : k + count]
        near = np.arange(len(a)) if few else _reachable(run, a, step, square)
        gap = _gaps(run, a[near], step[near], square[near])
        least = np.argmin(gap, axis=1)
        side[k : k + len(run)] = near[least]
        away[k : k + len(run)] = np.sqrt(gap[np.arange(len(run)), least])
    return away, side


def _gaps(points: Floats, a: Floats, step: Floats, square: Floats) -> Floats:
    """Return the squared distances (N, M) of points to sides that begin at `a`."""
    away = points[:, None, :] - a[None]
    share = np.clip((away * step).sum(axis=2) / square, 0.0, 1.0)
    gap = away - share[..., None] * step
    return (gap * gap).sum(axis=2)


def _reachable(points: Floats, a: Floats, step: Floats, square: Floats) -> Ints:
    """Return the sides that can be nearest to one of some points, seen from their middle."""
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    reach = float(np.sqrt(((points - middle) ** 2).sum(axis=1)).max())
    away = np.sqrt(_gaps(middle[None], a, step, square)[0])
    return np.flatnonzero(away <= (float(away.min()) + 2.0 * reach) * (1.0 + 1e-9) + 1e-9)


def turns(polygon: Floats) -> Floats:
    """Return tan(theta / 2) for the turn theta at each inner point of a polygon (N, 2); huge where it turns back."""
    step = np.diff(polygon, axis=0)
    unit = step / np.maximum(np.sqrt((step * step).sum(axis=1)), 1e-300)[:, None]
    cosine = np.clip((unit[:-1] * unit[1:]).sum(axis=1), -1.0, 1.0)
    cross = np.abs(unit[:-1, 0] * unit[1:, 1] - unit[:-1, 1] * unit[1:, 0])
    return cross / np.maximum(1.0 + cosine, 1e-9)


def rounded(start: Floats, corners: tuple[Corner, ...], end: Floats, sagitta: float) -> Floats:
    """Return points on a control polygon whose corners are rounded by tangent arcs, chords within `sagitta`."""
    polygon = np.array([start, *((x, y) for x, y, _ in corners), end])
    parts = [polygon[:1]]
    for k, (_, _, radius) in enumerate(corners):
        parts.append(arc(polygon[k], polygon[k + 1], polygon[k + 2], radius, sagitta))
    return np.concatenate([*parts, polygon[-1:]])


def arc(before: Floats, corner: Floats, after: Floats, radius: float, sagitta: float) -> Floats:
    """Return points on the arc that rounds a corner, its ends among them."""
    first, second = before - corner, after - corner
    first, second = (leg / max(float(np.hypot(*leg)), 1e-300) for leg in (first, second))
    tangent = float(turns(np.stack([before, corner, after]))[0]) * radius
    middle = first + second
    size = float(np.hypot(*middle))
    if size < 1e-12 or tangent < 1e-12:
        return corner[None]
    centre = corner + middle / size * sqrt(radius * radius + tangent * tangent)
    a, b = corner + tangent * first - centre, corner + tangent * second - centre
    whole = acos(min(1.0, max(-1.0, float((a * b).sum()) / (radius * radius))))
    chord = 2.0 * acos(max(-1.0, 1.0 - min(sagitta, radius) / radius))
    share = np.linspace(0.0, 1.0, max(2, ceil(whole / chord) + 1))[:, None]
    sine = np.sin(whole)
    if sine < 1e-9:
        return centre + np.stack([a, b])
    return centre + (np.sin((1.0 - share) * whole) * a + np.sin(share * whole) * b) / sine


def offset(line: Floats, left: float) -> Floats:
    """Return the polyline `left` metres to the left of a polyline (N, 2), its corners mitred."""
    step = np.diff(line, axis=0)
    unit = step / np.sqrt((step * step).sum(axis=1))[:, None]
    normal = np.stack([-unit[:, 1], unit[:, 0]], axis=-1)
    both = np.concatenate([normal[:1], normal[:-1] + normal[1:], normal[-1:]])
    square = np.maximum((both * both).sum(axis=1), 0.1)
    share = np.concatenate([[1.0], 2.0 / square[1:-1], [1.0]])
    return line + left * share[:, None] * both


def true_length(ends: Floats, corners: tuple[Corner, ...]) -> float:
    """Return the length of a control polygon whose corners are rounded by tangent arcs."""
    polygon = np.array([ends[0], *((x, y) for x, y, _ in corners), ends[1]])
    half = turns(polygon)
    radii = np.array([radius for _, _, radius in corners])
    return float(along(polygon)[-1] + (2.0 * radii * (np.arctan(half) - half)).sum())
