"""What a network must give before rules 2 and 3 are defined on it (RULES, *Ground*)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from dubins_traffic.cars.body import Car
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.roads.cells import covered, pairs
from dubins_traffic.roads.network import RoadNetwork

LEAST_RADIUS = 2.9
"""R is at least this many w."""
SLACK = 1e-9
"""Metres by which rounding may fall short of a demand."""


def check_demands(
    network: RoadNetwork, radius: float, car: Car, sensing_radius: float, rules: Mapping[str, Any]
) -> None:
    """Refuse a problem that asks for the rules where they are not defined.

    Parameters
    ----------
    network : RoadNetwork
        The roads.
    radius : float
        R, the intersection radius, metres.
    car : Car
        Gives w and rho.
    sensing_radius : float
        Metres.
    rules : Mapping
        The parameters `segment_slack` and `sensing_slack`, metres.

    Raises
    ------
    InputError
        Naming the place: segment, intersection or setting.
    """
    reach = radius + car.body.reach
    if radius < LEAST_RADIUS * car.w - SLACK:
        raise _undefined("R is too small", "intersection_radius", radius, LEAST_RADIUS * car.w)
    sight = 2.0 * (reach + rules["sensing_slack"])
    if sensing_radius < sight - SLACK:
        raise _undefined("sees too little", "sensing_radius", sensing_radius, sight)
    shortest = 2.0 * reach + rules["segment_slack"]
    lengths = network.lengths
    k = int(np.argmin(lengths))
    if lengths[k] < shortest - SLACK:
        place = f"segments[{k}] {list(network.segments[k])}"
        raise _undefined(f"{place} is too short", "rnd", float(lengths[k]), shortest)
    _check_clearances(network, 2.0 * reach, reach + 2.0 * car.w)


def _check_clearances(network: RoadNetwork, apart: float, aside: float) -> None:
    """Refuse intersections closer than `apart` to each other, or than `aside` to a segment not ending there."""
    points, ends = network.points, network.ends
    count = len(ends)
    start = np.concatenate([points[ends[:, 0]], points])
    end = np.concatenate([points[ends[:, 1]], points])
    widest = max(apart, aside)
    for first, second in pairs(*covered(start, end, 0.5 * widest, widest)):
        low, high = np.minimum(first, second), np.maximum(first, second)
        v = high - count
        both = (low >= count) & (v != low - count)
        _check_apart(network, low[both] - count, v[both], apart)
        mixed = (low < count) & (v >= 0)
        _check_aside(network, low[mixed], v[mixed], aside)


def _check_apart(network: RoadNetwork, first: Ints, second: Ints, least: float) -> None:
    gap = network.points[first] - network.points[second]
    distance = _norm(gap)
    if len(distance) and float(distance.min()) < least - SLACK:
        k = int(np.argmin(distance))
        a, b = (list(network.intersections[int(v[k])]) for v in (first, second))
        raise _undefined(f"intersections {a} and {b} are too close", "rnd", float(distance[k]), least)


def _check_aside(network: RoadNetwork, s: Ints, v: Ints, least: float) -> None:
    ends = network.ends[s]
    loose = (ends[:, 0] != v) & (ends[:, 1] != v)
    s, v = s[loose], v[loose]
    distance = _distance(network, s, network.points[v])
    if len(distance) and float(distance.min()) < least - SLACK:
        k = int(np.argmin(distance))
        point = list(network.intersections[int(v[k])])
        problem = f"intersection {point} is too close to segments[{int(s[k])}]"
        raise _undefined(problem, "rnd", float(distance[k]), least)


def _undefined(problem: str, field: str, value: float, least: float) -> InputError:
    return InputError(
        f"the rules are not defined here: {problem}",
        field=field,
        value=value,
        expected=f"at least {least:.6g} m, or rules: false",
    )


def _distance(network: RoadNetwork, s: Ints, p: Floats) -> Floats:
    """Distances from points `p` (K, 2) to the segments `s` (K,)."""
    a = network.points[network.ends[s, 0]]
    t = network.tangents[s]
    along = np.clip((p[:, 0] - a[:, 0]) * t[:, 0] + (p[:, 1] - a[:, 1]) * t[:, 1], 0.0, network.lengths[s])
    return _norm(p - a - along[:, None] * t)


def _norm(vectors: Floats) -> Floats:
    return np.sqrt(vectors[:, 0] * vectors[:, 0] + vectors[:, 1] * vectors[:, 1])
