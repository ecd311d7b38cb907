"""Random road networks for tests, made by hand: parts of grids, turned and moved, and roads that wind."""

from __future__ import annotations

from cmath import phase
from itertools import pairwise
from math import tan
from random import Random
from typing import Any

from hypothesis import strategies as st

from dubins_traffic.roads.formats.rnd import extent
from dubins_traffic.roads.network import RoadNetwork

WINDING = 24.0
"""Units between the intersections of winding networks."""
_STRAIGHT, _LEAST, _ASIDE, _TURNED = 2.0, 1.0, 2.5, 0.24
"""What is straight at an end, the least radius, how far corners lie aside, units; by how much an end is turned."""


@st.composite
def networks(draw: st.DrawFn, length: float = 3.0, most: int = 6) -> RoadNetwork:
    """Draw a connected part of a grid: a random tree on some of its points and some of the other segments."""
    rows, columns = draw(st.integers(1, most)), draw(st.integers(2, most))
    grid = list(RoadNetwork.grid(rows, columns).segments)
    order = draw(st.permutations(grid))
    extra = draw(st.floats(0.0, 1.0))
    group: dict[Any, Any] = {}

    def root(point: Any) -> Any:
        while group.get(point, point) != point:
            point = group[point]
        return point

    kept = []
    for k, (x0, y0, x1, y1) in enumerate(order):
        a, b = root((x0, y0)), root((x1, y1))
        if a != b:
            group[a] = b
            kept.append((x0, y0, x1, y1))
        elif k < extra * len(order):
            kept.append((x0, y0, x1, y1))
    transform = tuple(draw(st.floats(-b, b)) for b in (100.0, 100.0, 10.0))
    return RoadNetwork(tuple(kept), length, transform, (rows, columns))


def winding(seed: int, most: int = 2) -> RoadNetwork:
    """Return crossings of three or four roads with dead ends around, whose roads wind; no intersection has two roads.

    Roads run either way, keep the room of the rules, and have up to six corners of different radii; now and then two
    arcs fill the side between them.
    """
    dice = Random(seed)
    rows, columns = dice.randint(1, most), dice.randint(1, most)
    inner = {(x, y) for x in range(1, columns + 1) for y in range(1, rows + 1)}
    grid = RoadNetwork.grid(rows + 2, columns + 2).segments
    kept = [row for row in grid if {row[:2], row[2:]} & inner]
    for point in inner:
        stubs = [row for row in kept if point in (row[:2], row[2:]) and not {row[:2], row[2:]} <= inner]
        if stubs and dice.random() < 0.5:
            kept.remove(dice.choice(stubs))
    segments: list[Any] = []
    corners: list[Any] = []
    for x0, y0, x1, y1 in kept:
        ends = (x0, y0, x1, y1) if dice.random() < 0.5 else (x1, y1, x0, y0)
        segments.append(tuple(WINDING * number for number in ends))
        corners.append(_winding(segments[-1], dice))
    transform = dice.uniform(-1e3, 1e3), dice.uniform(-1e3, 1e3), dice.uniform(-7.0, 7.0)
    return RoadNetwork(tuple(segments), dice.choice((1.0, 1.25)), transform, extent(segments), {}, tuple(corners))


def _winding(row: tuple[float, ...], dice: Random) -> tuple[tuple[float, float, float], ...]:
    """Return the corners of a road that winds between both ends, none where it is to be straight."""
    start, end = complex(*row[:2]), complex(*row[2:])
    step = (end - start) / abs(end - start)
    count = dice.randint(0, 6)
    for _ in range(200):
        along = [4.0 + (WINDING - 8.0) * (k + dice.uniform(0.1, 0.9)) / max(count, 1) for k in range(count)]
        points = [start, *(start + step * complex(s, dice.uniform(-_ASIDE, _ASIDE)) for s in along), end]
        sides = [q - p for p, q in pairwise(points)]
        halves = [abs(tan(0.5 * phase(b / a))) for a, b in pairwise(sides)]
        free = [abs(side) for side in sides]
        free[0], free[-1] = free[0] - _STRAIGHT, free[-1] - _STRAIGHT
        radii: list[float] = []
        for k, half in enumerate(halves):
            # Of a side between two corners the first takes half, the second what is left.
            room = min(free[k], free[k + 1] * (1.0 if k + 1 == len(halves) else 0.5))
            radii.append(room / half * (1.0 if dice.random() < 0.3 else dice.uniform(0.5, 1.0)))
            free[k + 1] -= radii[-1] * half
        turned = max(abs(phase(side / step)) for side in (sides[0], sides[-1]))
        if turned < _TURNED and all(_LEAST <= radius <= 1e3 for radius in radii) and max(halves, default=0.0) < 1.0:
            return tuple((p.real, p.imag, r) for p, r in zip(points[1:-1], radii, strict=True))
    return ()
