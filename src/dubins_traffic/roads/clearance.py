"""Room to judge rules 2 and 3: how far apart segments, intersections and arms must be (docs/rules.md#room)."""

from __future__ import annotations

from math import acos, pi
from typing import NamedTuple, cast

import numpy as np

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.roads.chains import Bars
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.roads.room import LEAST_RADIUS, SEGMENT_SLACK, Clearances, clearances
from dubins_traffic.roads.surface import covered, pairs

ROUNDING = 1e-9
STRAIGHTENED = 1e-3
"""How far a curve may be from the bars that stand for it where its clearance is measured, metres."""
TIGHTEST = 3.0
"""Arcs have a radius of at least this many w."""
SAMPLED = 0.1
"""Roads are measured about this many metres apart, for w = 0.3 m."""
FAR_ALONG = 9.0
"""Points of one road that are farther apart along it than this many w must be apart like those of two roads."""


class Tight(NamedTuple):
    """What falls short.

    Attributes
    ----------
    short : (K,) int64
        Segments.
    close : (K, 2) int64
        Pairs of intersections.
    beside : (K, 2) int64
        Intersections and segments.
    sharp : (K, 3) int64
        Intersections and two segments that meet there.
    """

    short: Ints
    close: Ints
    beside: Ints
    sharp: Ints


def tight(points: Floats, ends: Ints, least: Clearances) -> Tight:
    """Return the places where segments between `points` (V, 2) with `ends` (S, 2) fall short of `least`."""
    a, b = points[ends[:, 0]], points[ends[:, 1]]
    short = np.flatnonzero(_norm(b - a) < least.length - ROUNDING)
    close, beside = _crowded(points, ends, Bars(np.arange(len(ends)), a, b), least)
    hub, tip, segment = _tips(ends)
    return Tight(short, close, beside, _sharp(hub, points[tip] - points[hub], segment, least.cosine))


def bent_tight(network: RoadNetwork, least: Clearances) -> Tight:
    """Return the places where a network whose segments bend falls short of `least`."""
    short = np.flatnonzero(network.lengths < least.length - ROUNDING)
    bars = network.surface.bars(STRAIGHTENED)
    close, beside = _crowded(network.points, network.ends, bars, least)
    hub = np.concatenate([network.ends[:, 0], network.ends[:, 1]])
    step = np.concatenate([network.tangents, -network.end_tangents])
    order = np.argsort(hub, kind="stable")
    segment = order % max(len(network.ends), 1)
    return Tight(short, close, beside, _sharp(hub[order], step[order], segment, least.cosine))


def _crowded(points: Floats, ends: Ints, bars: Bars, least: Clearances) -> tuple[Ints, Ints]:
    """Return the pairs of points that are too close, and of points and segments, which the `bars` stand for."""
    a, b, count = bars.start, bars.end, len(bars.owner)
    wide = max(least.apart, least.aside)
    size = max(wide, float(np.abs(b - a).mean()))
    rows = covered(np.concatenate([a, points]), np.concatenate([b, points]), 0.5 * wide, size)
    close: list[Ints] = []
    beside: list[Ints] = []
    for first, second in pairs(*rows):
        low, high = np.minimum(first, second), np.maximum(first, second)
        apart = (low >= count) & (low < high)
        couple = np.stack([low[apart], high[apart]], axis=-1) - count
        gap = _norm(points[couple[:, 0]] - points[couple[:, 1]])
        close.append(couple[gap < least.apart - ROUNDING])
        mixed = (low < count) & (high >= count)
        k, v = low[mixed], high[mixed] - count
        loose = (ends[bars.owner[k]] != v[:, None]).all(axis=1)
        k, v = k[loose], v[loose]
        far = distances(points[v], a[k], b[k])
        beside.append(np.stack([v, bars.owner[k]], axis=-1)[far < least.aside - ROUNDING])
    return _distinct(close), _distinct(beside)


def _tips(ends: Ints) -> tuple[Ints, Ints, Ints]:
    """Return the roads out of intersections, by these: intersection, the one at the other end, segment."""
    hub = np.concatenate([ends[:, 0], ends[:, 1]])
    tip = np.concatenate([ends[:, 1], ends[:, 0]])
    order = np.argsort(hub, kind="stable")
    return hub[order], tip[order], order % max(len(ends), 1)


def _sharp(hub: Ints, step: Floats, segment: Ints, cosine: float) -> Ints:
    """Return intersections and pairs of segments that make an angle there whose cosine is not below `cosine`.

    `hub` (K,), ascending, are the intersections out of which roads lead in the direction `step` (K, 2).

    Norm: docs/rules.md#arms.
    """
    step = step / _norm(step)[:, None]
    found: list[Ints] = []
    for gap in (1, 2, 3):
        same = np.flatnonzero(hub[:-gap] == hub[gap:]) if len(hub) > gap else np.empty(0, dtype=np.int64)
        other = same + gap
        acute = (step[same] * step[other]).sum(axis=1) > cosine - ROUNDING
        found.append(np.stack([hub[same], segment[same], segment[other]], axis=-1)[acute])
    return np.concatenate(found)


def clearance_faults(
    network: RoadNetwork, radius: float, reach: float, w: float, slack: float = SEGMENT_SLACK
) -> list[InputError]:
    """Return why rules 2 and 3 are not defined on a network, each fault with its place; empty if they are.

    Parameters
    ----------
    network : RoadNetwork
        The network.
    radius : float
        R, the intersection radius, metres.
    reach : float
        rho, from a body's centre to its farthest point, metres.
    w : float
        Nominal width of a car, metres.
    slack : float
        Metres that a segment must be longer than the discs and bodies at its ends.
    """
    least = clearances(radius, reach, w, slack)
    points, ends, names = network.points, network.ends, network.intersections
    faults: list[InputError] = []
    if radius < LEAST_RADIUS * w - ROUNDING:
        expected = f"at least {LEAST_RADIUS} w = {LEAST_RADIUS * w:.6g} m"
        faults.append(InputError("too small", field="intersection_radius", value=radius, expected=expected))
    if not network.is_straight:
        faults += curve_faults(network, radius, reach, w, slack)
        if faults:
            return faults
    if least not in network.known:
        network.known[least] = (
            tight(points, ends, least) if network.is_straight else bent_tight(network, least)
        )
    found = cast(Tight, network.known[least])
    for s in found.short.tolist():
        faults.append(_fault("too short", s, float(network.lengths[s]), f"at least {least.length:.6g} m"))
    for v, other in _couples(found.close):
        s = int(np.flatnonzero((ends == v).any(axis=1))[0])
        gap = float(_norm(points[v] - points[other]))
        problem = f"intersections {list(names[v])} and {list(names[other])} are too close"
        faults.append(_fault(problem, s, gap, f"at least {least.apart:.6g} m"))
    for v, s in _couples(found.beside):
        gap = float(np.sqrt(network.surface.distance2(points[v, 0], points[v, 1], np.array(s))))
        problem = f"intersection {list(names[v])} is too close to the road"
        faults.append(_fault(problem, s, gap, f"at least {least.aside:.6g} m"))
    for v, first, second in found.sharp.tolist():
        faults.append(_sharp_fault(network, v, first, second, least.cosine))
    return faults


def distances(p: Floats, a: Floats, b: Floats) -> Floats:
    """Return the distances from points p to segments from a to b, each (..., 2)."""
    step, away = b - a, p - a
    along = (away * step).sum(axis=-1) / (step * step).sum(axis=-1)
    return _norm(away - np.clip(along, 0.0, 1.0)[..., None] * step)


def _norm(vectors: Floats) -> Floats:
    return np.sqrt((vectors * vectors).sum(axis=-1))


def _distinct(rows: list[Ints]) -> Ints:
    return np.unique(np.concatenate(rows), axis=0) if rows else np.empty((0, 2), dtype=np.int64)


def _couples(rows: Ints) -> list[tuple[int, int]]:
    return [(int(row[0]), int(row[1])) for row in rows]


def _sharp_fault(network: RoadNetwork, v: int, first: int, second: int, cosine: float) -> InputError:
    low, high = sorted((first, second))
    step = [network.tangents[s] if network.ends[s, 0] == v else -network.end_tangents[s] for s in (low, high)]
    between = float((step[0] * step[1]).sum())
    return InputError(
        f"too sharp an angle with segments[{low}] at {list(network.intersections[v])}",
        field=f"segments[{high}]",
        value=round(180.0 * acos(min(max(between, -1.0), 1.0)) / pi, 2),
        expected=f"more than {180.0 * acos(max(cosine, -1.0)) / pi:.4g} degrees",
    )


def curve_faults(
    network: RoadNetwork, radius: float, reach: float, w: float, slack: float
) -> list[InputError]:
    """Return where segments that bend are not straight near their ends, too sharp, or too close to others.

    Parameters are those of `roads.clearance.clearance_faults`.

    Norm: docs/rules.md#curves.
    """
    chains = network.chains
    faults: list[InputError] = []
    straight = radius + reach + slack
    for s in np.flatnonzero(network.bent).tolist():
        own = slice(int(chains.first[s]), int(chains.first[s + 1]))
        for which, k in (("first", own.start), ("second", own.stop - 1)):
            if chains.length[k] < straight - ROUNDING:
                corner = 0 if which == "first" else len(network.corners[s]) - 1
                problem = f"corner {corner}: too near to the {which} end"
                expected = f"a straight road for at least {straight:.6g} m from there"
                faults.append(_fault(problem, s, float(chains.length[k]), expected))
        for corner, (_, _, given) in enumerate(network.corners[s]):
            own_radius = given * network.length
            if own_radius < TIGHTEST * w - ROUNDING:
                expected = f"a radius of at least {TIGHTEST:g} w = {TIGHTEST * w:.6g} m"
                faults.append(_fault(f"corner {corner}: too sharp a curve", s, own_radius, expected))
    return faults or _overlaps(network, straight, 4.0 * w + reach, w)


def _overlaps(network: RoadNetwork, straight: float, least: float, w: float) -> list[InputError]:
    """Return pairs of roads, of which one bends at least, that are less than `least` metres apart.

    They are measured beyond the `straight` metres at their ends: there they may meet.
    """
    owner, along, place = _samples(network, straight, SAMPLED * w / 0.3)
    found: dict[tuple[int, int], float] = {}
    for one, other in pairs(*covered(place, place, 0.5 * least, max(least, 1e-9))):
        low, high = owner[one], owner[other]
        apart = (low != high) | (np.abs(along[one] - along[other]) >= FAR_ALONG * w)
        apart &= network.bent[low] | network.bent[high]
        first, second = one[apart], other[apart]
        step = place[first] - place[second]
        far = np.sqrt((step * step).sum(axis=-1))
        for k in np.flatnonzero(far < least - ROUNDING).tolist():
            pair = int(min(owner[first[k]], owner[second[k]])), int(max(owner[first[k]], owner[second[k]]))
            found[pair] = min(found.get(pair, np.inf), float(far[k]))
    faults: list[InputError] = []
    for low, high in sorted(found, key=lambda pair: (pair[1], pair[0])):
        s, other = (high, low) if network.bent[high] else (low, high)
        problem = "comes too close to itself" if s == other else f"comes too close to segments[{other}]"
        faults.append(
            _fault(problem, s, found[low, high], f"at least {least:.6g} m between the middles of roads")
        )
    return faults


def _samples(network: RoadNetwork, straight: float, apart: float) -> tuple[Ints, Floats, Floats]:
    """Return points about `apart` metres apart: their segments (K,), metres along these (K,), places (K, 2)."""
    owner: list[Ints] = []
    along: list[Floats] = []
    place: list[Floats] = []
    for s, length in enumerate(network.lengths.tolist()):
        count = int(max(length - 2.0 * straight, 0.0) / apart) + 2
        low, high = min(straight, 0.5 * length), max(length - straight, 0.5 * length)
        own = cast(Floats, np.linspace(low, high, count))
        if network.bent[s]:
            spots, _ = network.chains.places(s, own)
        else:
            spots = cast(Floats, network.points[network.ends[s, 0]] + own[:, None] * network.tangents[s])
        owner.append(np.full(count, s))
        along.append(own)
        place.append(spots)
    return np.concatenate(owner), np.concatenate(along), np.concatenate(place)


def _fault(problem: str, s: int, value: float, expected: str) -> InputError:
    return InputError(problem, field=f"segments[{s}]", value=value, expected=expected)
