"""Networks woven from a grid: points of a grid of any outline, moved at random as far as the clearances allow."""

from __future__ import annotations

import heapq
from math import ceil, isqrt

import numpy as np

from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.roads.checks import meetings
from dubins_traffic.roads.clearance import Clearances, tight

PITCH = 1.35
"""Distance of neighbours in the grid, in least lengths of a segment."""
SHIFT = 0.45
"""How far a point may be moved, in pitches."""
ROUNDS = 12
"""After so many rounds, points that are still in the way stay on the grid."""
OUTLINES = (4.0, 2.0, 1.0, 0.5)
"""How ragged an outline to try, from the most."""

Site = tuple[int, int]


def draw_from_grid(
    draws: Draws, count: int, roads: int, least: Clearances
) -> tuple[list[Site], list[tuple[int, int]]]:
    """Return `count` lattice points and `roads` roads between them, as pairs of their numbers.

    Parameters
    ----------
    draws : Draws
        Random numbers.
    count, roads : int
        count - 1 <= roads <= floor(2 count - 2 sqrt(count)), what the densest outline has.
    least : Clearances
        In lattice units; its angle at most pi / 2.
    """
    sites, couples = _outline(draws, count, roads)
    ends = np.array(_choose(draws, count, couples, roads), dtype=np.int64)
    pitch = ceil(PITCH * max(least.length, least.apart, least.aside))
    grid = pitch * np.array(sites, dtype=np.float64)
    shift = np.array([[draws.uniform(-1.0, 1.0) for _ in range(2)] for _ in range(count)]) * SHIFT * pitch
    scale = np.ones(count)
    points = grid
    for k in range(count + ROUNDS + 1):
        points = grid + np.rint(scale[:, None] * shift)
        bad = _in_the_way(points, ends, least)
        if not bad.any():
            break
        scale[bad] = scale[bad] * 0.75 if k < ROUNDS else 0.0
    return [(int(x), int(y)) for x, y in points], [(int(a), int(b)) for a, b in ends]


def most_segments(count: int) -> int:
    """Return floor(2 N - 2 sqrt(N)), the most segments of a part of the grid with N points.

    Source: F. Harary, H. Harborth, "Extremal animals", Journal of Combinatorics, Information and System
    Sciences 1, 1976.
    """
    return 2 * count - isqrt(4 * count - 1) - 1


def spanning(count: int, couples: list[tuple[int, int]]) -> list[bool]:
    """Return which of the couples, taken in order, join two parts that were not joined before."""
    above = list(range(count))

    def root(v: int) -> int:
        while above[v] != v:
            above[v] = above[above[v]]
            v = above[v]
        return v

    joins: list[bool] = []
    for a, b in couples:
        p, q = root(a), root(b)
        joins.append(p != q)
        above[p] = q
    return joins


def _outline(draws: Draws, count: int, roads: int) -> tuple[list[Site], list[tuple[int, int]]]:
    """Return sites of the grid and its couples of neighbours, of the most ragged outline that has enough."""
    couples: list[tuple[int, int]] = []
    for ragged in OUTLINES:
        sites = _ragged(draws, count, ragged)
        couples = _neighbours(sites)
        if len(couples) >= roads:
            return sites, couples
    sites = _dense(count)
    return sites, _neighbours(sites)


def _ragged(draws: Draws, count: int, ragged: float) -> list[Site]:
    """Return sites taken one after another from the border, mostly the nearest to the middle."""
    sites: list[Site] = []
    seen = {(0, 0)}
    border: list[tuple[float, Site]] = [(0.0, (0, 0))]
    while len(sites) < count:
        _, (x, y) = heapq.heappop(border)
        sites.append((x, y))
        for near in ((x + 1, y), (x, y + 1), (x - 1, y), (x, y - 1)):
            if near not in seen:
                seen.add(near)
                far = max(abs(near[0]), abs(near[1]))
                heapq.heappush(border, (far + ragged * draws.uniform(), near))
    return sites


def _dense(count: int) -> list[Site]:
    """Return the square, then the sites of a further column, then of a row."""
    side = isqrt(count)
    sites = [(x, y) for x in range(side) for y in range(side)]
    sites += [(side, y) for y in range(side)] + [(x, side) for x in range(side + 1)]
    return sites[:count]


def _neighbours(sites: list[Site]) -> list[tuple[int, int]]:
    number = {site: v for v, site in enumerate(sites)}
    couples: list[tuple[int, int]] = []
    for v, (x, y) in enumerate(sites):
        couples += [(v, number[near]) for near in ((x + 1, y), (x, y + 1)) if near in number]
    return couples


def _choose(draws: Draws, count: int, couples: list[tuple[int, int]], roads: int) -> list[tuple[int, int]]:
    """Return a random tree of the couples and as many others as are asked for."""
    order = [couples[k] for k in draws.shuffled(len(couples))]
    joins = spanning(count, order)
    tree = [couple for couple, joined in zip(order, joins, strict=True) if joined]
    others = [couple for couple, joined in zip(order, joins, strict=True) if not joined]
    return tree + others[: roads - len(tree)]


def _in_the_way(points: Floats, ends: Ints, least: Clearances) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Return which points have a part in something that is too close, too sharp or crosses."""
    bad = np.zeros(len(points), dtype=np.bool_)
    found = tight(points, ends, least)
    bad[ends[found.short].ravel()] = True
    bad[found.close.ravel()] = True
    bad[found.beside[:, 0]] = True
    bad[ends[found.beside[:, 1]].ravel()] = True
    segment = np.concatenate([points[ends[:, 0]], points[ends[:, 1]]], axis=1).astype(np.int64)
    bad[ends[meetings(segment).ravel()].ravel()] = True
    bad[ends[found.sharp[:, 1:].ravel()].ravel()] = True
    return bad
