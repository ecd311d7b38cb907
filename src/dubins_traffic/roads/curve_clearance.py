"""What docs/rules.md#room demands besides of segments that bend: straight ends, wide arcs, roads apart."""

from __future__ import annotations

from typing import cast

import numpy as np

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.roads.cells import covered, pairs
from dubins_traffic.roads.network import RoadNetwork

TIGHTEST = 3.0
"""Arcs have a radius of at least this many w."""
SAMPLED = 0.1
"""Roads are measured about this many metres apart, for w = 0.3 m."""
FAR_ALONG = 9.0
"""Points of one road that are farther apart along it than this many w must be apart like those of two roads."""
ROUNDING = 1e-9


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
