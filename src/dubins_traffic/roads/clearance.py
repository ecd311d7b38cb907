"""Room to judge rules 2 and 3: how far apart segments, intersections and arms must be (docs/rules.md#room)."""

from __future__ import annotations

from math import acos, hypot, pi
from typing import NamedTuple, cast

import numpy as np

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.roads.chains import Bars
from dubins_traffic.roads.closeness import ROUNDING, Finder, finder
from dubins_traffic.roads.cover import covered, pairs
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.roads.room import LEAST_RADIUS, SEGMENT_SLACK, Clearances, clearances

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
    bars = Bars(np.arange(len(ends)), points[ends[:, 0]], points[ends[:, 1]])
    return _told(_finder(points, ends, bars).tight(least))


def bent_tight(network: RoadNetwork, least: Clearances) -> Tight:
    """Return the places where a network whose segments bend falls short of `least`."""
    search = _finder(network.points, network.ends, network.bars(STRAIGHTENED))
    hub = np.concatenate([network.ends[:, 0], network.ends[:, 1]])
    step = np.concatenate([network.tangents, -network.end_tangents])
    order = np.argsort(hub, kind="stable")
    arm = search.frame.arm
    arm["hub"], arm["segment"] = hub[order], order % max(len(network.ends), 1)
    arm["dx"], arm["dy"] = (step / _norm(step)[:, None])[order].T
    short = np.flatnonzero(network.lengths < least.length - ROUNDING)
    return _told(search.crowded_and_sharp(least))._replace(short=short)


def _finder(points: Floats, ends: Ints, bars: Bars) -> Finder:
    """Return what finds what falls short in a network of which the `bars` are the roads."""
    search = finder(len(points), len(bars.owner), 2 * len(ends))
    node, bar = search.frame.node, search.frame.bar
    node["x"], node["y"] = points.T
    search.put_bars(bars.start, bars.end)
    bar["owner"] = bars.owner
    bar["a"], bar["b"] = ends[bars.owner].T
    return search


def _told(sides: Ints) -> Tight:
    """Return what kernels have found (`roads.closeness.Hit`), in order."""
    vertices, segments = (sides[:, :2] >= 0).sum(axis=1), (sides[:, 2:] >= 0).sum(axis=1)
    short, close = sides[vertices == 0, 2], sides[vertices == 2, :2]
    beside, sharp = sides[(vertices == 1) & (segments == 1)], sides[(vertices == 1) & (segments == 2)]
    return Tight(short, _distinct(close), _distinct(beside[:, [0, 2]]), sharp[:, [0, 2, 3]])


def _distinct(rows: Ints) -> Ints:
    return np.unique(rows, axis=0) if len(rows) else rows


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
        network.known[least] = tight(points, ends, least) if network.is_straight else bent_tight(network, least)
    narrow = cast(Tight, network.known[least])
    for s in narrow.short.tolist():
        faults.append(_fault("too short", s, float(network.lengths[s]), f"at least {least.length:.6g} m"))
    for v, other in _couples(narrow.close):
        s = int(np.flatnonzero((ends == v).any(axis=1))[0])
        gap = float(_norm(points[v] - points[other]))
        problem = f"intersections {list(names[v])} and {list(names[other])} are too close"
        faults.append(_fault(problem, s, gap, f"at least {least.apart:.6g} m"))
    for v, s in _couples(narrow.beside):
        along, left = (float(each) for each in network.lane_coordinates(2 * s, points[v]))
        gap = hypot(left, max(-along, along - float(network.lengths[s]), 0.0))
        problem = f"intersection {list(names[v])} is too close to the road"
        faults.append(_fault(problem, s, gap, f"at least {least.aside:.6g} m"))
    for v, first, second in narrow.sharp.tolist():
        faults.append(_sharp_fault(network, v, first, second, least.cosine))
    return faults


def _norm(vectors: Floats) -> Floats:
    return np.sqrt((vectors * vectors).sum(axis=-1))


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


def curve_faults(network: RoadNetwork, radius: float, reach: float, w: float, slack: float) -> list[InputError]:
    """Return where segments that bend are not straight near their ends, too sharp, or too close to others.

    Parameters are those of `roads.clearance.clearance_faults`.

    Norm: docs/rules.md#curves.
    """
    chains = network.chains
    faults: list[InputError] = []
    straight = radius + reach + slack
    for s in np.flatnonzero(network.bent).tolist():
        pieces = slice(int(chains.first[s]), int(chains.first[s + 1]))
        for which, k in (("first", pieces.start), ("second", pieces.stop - 1)):
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
    deepest: dict[tuple[int, int], float] = {}
    for one, other in pairs(*covered(place, place, 0.5 * least, max(least, 1e-9))):
        low, high = owner[one], owner[other]
        apart = (low != high) | (np.abs(along[one] - along[other]) >= FAR_ALONG * w)
        apart &= network.bent[low] | network.bent[high]
        first, second = one[apart], other[apart]
        step = place[first] - place[second]
        far = np.sqrt((step * step).sum(axis=-1))
        for k in np.flatnonzero(far < least - ROUNDING).tolist():
            pair = int(min(owner[first[k]], owner[second[k]])), int(max(owner[first[k]], owner[second[k]]))
            deepest[pair] = min(deepest.get(pair, np.inf), float(far[k]))
    faults: list[InputError] = []
    for low, high in sorted(deepest, key=lambda pair: (pair[1], pair[0])):
        s, other = (high, low) if network.bent[high] else (low, high)
        problem = "comes too close to itself" if s == other else f"comes too close to segments[{other}]"
        faults.append(_fault(problem, s, deepest[low, high], f"at least {least:.6g} m between the middles of roads"))
    return faults


def _samples(network: RoadNetwork, straight: float, apart: float) -> tuple[Ints, Floats, Floats]:
    """Return points about `apart` metres apart: their segments (K,), metres along these (K,), places (K, 2)."""
    owner: list[Ints] = []
    along: list[Floats] = []
    place: list[Floats] = []
    for s, length in enumerate(network.lengths.tolist()):
        count = int(max(length - 2.0 * straight, 0.0) / apart) + 2
        low, high = min(straight, 0.5 * length), max(length - straight, 0.5 * length)
        shares = cast(Floats, np.linspace(low, high, count))
        if network.bent[s]:
            spots, _ = network.chains.places(s, shares)
        else:
            spots = cast(Floats, network.points[network.ends[s, 0]] + shares[:, None] * network.tangents[s])
        owner.append(np.full(count, s))
        along.append(shares)
        place.append(spots)
    return np.concatenate(owner), np.concatenate(along), np.concatenate(place)


def _fault(problem: str, s: int, value: float, expected: str) -> InputError:
    return InputError(problem, field=f"segments[{s}]", value=value, expected=expected)
