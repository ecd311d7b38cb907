"""Pairs of one-way roads beside each other, one for each direction, as one road in their middle.

Where a one-way road ends, the nearest road of the other direction on its left is cut at the place beside that end, and
the junctions of both become one in their middle. Then two pieces between the same two junctions, one each way, are the
lanes of one road. What lies within a junction that was made so is left out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import pairwise
from math import ceil
from typing import NamedTuple

import numpy as np

from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.maps.junctions import Union, gap, spread
from dubins_traffic.maps.model import Junction, Road, RoadMap, map_of
from dubins_traffic.maps.polylines import along, at, cleaned, stretch

FACING = -0.8
"""Roads face each other where the cosine between their directions is at most this."""
SHORT = 1e-150
"""A side is at least this long, metres, so that its square is not 0 where a road has no length."""
SNAP = 0.5
"""A road is not cut nearer than so many times the distance asked for to one of its ends: the end is taken."""
INSIDE = 3.0
"""Roads of a junction that was made of several are left out up to so many times that distance."""
UNEVEN = 2.0
"""Two pieces are lanes of one road where they are nowhere farther apart than so many times that distance."""


def merged(road_map: RoadMap, within: float) -> RoadMap:
    """Return a map whose pairs of one-way roads at most `within` metres apart are roads with one lane each way."""
    ways = {
        k: _forward(road)
        for k, road in enumerate(road_map.roads)
        if bool(road.forward) != bool(road.backward) and not road.closed
    }
    if not ways:
        return road_map
    beside = _Sides(ways, within)
    union = Union[str]()
    places = {name: np.array(junction[:2]) for name, junction in road_map.junctions.items()}
    cuts: dict[int, dict[str, float]] = {k: {} for k in ways}
    for way in ways.values():
        for name, begins in ((way.first, True), (way.last, False)):
            facing = beside.facing(places[name], *_heading(way.line, begins=begins), name)
            if facing is None:
                continue
            k, metres = facing
            union.join((name, _cut(cuts[k], ways[k], k, metres, name, SNAP * within, places)))
    junctions, named = _joined(union, places, road_map.junctions)
    whole, pieces = list[Road](), list[Road]()
    for k, road in enumerate(road_map.roads):
        parts = _pieces(ways[k], cuts[k]) if k in ways else [road]
        for piece in parts:
            first, last = named(piece.first), named(piece.last)
            if first == last and piece.first != piece.last and piece.length <= INSIDE * within:
                continue
            (pieces if k in ways else whole).append(replace(piece, first=first, last=last))
    return map_of(junctions, (*whole, *_paired(pieces, UNEVEN * within)))


def _forward(road: Road) -> Road:
    """Return a one-way road with its line in the direction of its lanes, and no point of it doubled."""
    if road.forward:
        return replace(road, line=cleaned(road.line))
    line = cleaned(road.line[::-1])
    turned = replace(road, first=road.last, last=road.first, line=line, corners=None)
    return replace(turned, forward=road.backward, backward=0)


def _heading(line: Floats, *, begins: bool) -> tuple[float, float]:
    """Return the direction of a line at one of its ends, a unit vector."""
    step = line[1] - line[0] if begins else line[-1] - line[-2]
    unit = step / max(float(np.hypot(*step)), SHORT)
    return float(unit[0]), float(unit[1])


class _Sides:
    """The sides of one-way roads, found by the cell of a lattice near which they lie."""

    def __init__(self, ways: dict[int, Road], within: float) -> None:
        self._within, self._cell = within, 1.5 * within
        lines = {k: way.line for k, way in ways.items()}
        self._ends = {k: (way.first, way.last) for k, way in ways.items()}
        self._owner: Ints = np.concatenate([np.full(len(line) - 1, k) for k, line in lines.items()])
        self._begin: Floats = np.concatenate([line[:-1] for line in lines.values()])
        self._step: Floats = np.concatenate([np.diff(line, axis=0) for line in lines.values()])
        self._length: Floats = np.maximum(np.hypot(self._step[:, 0], self._step[:, 1]), SHORT)
        self._before: Floats = np.concatenate([along(line)[:-1] for line in lines.values()])
        self._cells: dict[tuple[int, int], set[int]] = {}
        for side, (begin, step, length) in enumerate(zip(self._begin, self._step, self._length, strict=True)):
            shares = np.linspace(0.0, 1.0, ceil(2.0 * float(length) / within) + 1)
            for x, y in np.floor((begin + shares[:, None] * step) / self._cell).astype(np.int64).tolist():
                self._cells.setdefault((x, y), set()).add(side)

    def facing(self, point: Floats, c: float, s: float, junction: str) -> tuple[int, float] | None:
        """Return the nearest road to the left that faces the direction (c, s), and metres along it.

        None if there is none, or that road ends in the junction itself.
        """
        x, y = np.floor(point / self._cell).astype(np.int64).tolist()
        cells = [(x + i, y + j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
        sides = np.array(sorted(set[int]().union(*(self._cells.get(cell, set()) for cell in cells))), dtype=np.int64)
        if not len(sides):
            return None
        begin, step, length = self._begin[sides], self._step[sides], self._length[sides]
        share = np.clip(((point - begin) * step).sum(axis=1) / length**2, 0.0, 1.0)
        away = begin + share[:, None] * step - point
        far = np.hypot(away[:, 0], away[:, 1])
        ends = [junction in self._ends[int(k)] for k in self._owner[sides]]
        left = (c * away[:, 1] - s * away[:, 0] > 0.0) | np.array(ends)
        faces = (step[:, 0] * c + step[:, 1] * s) / length <= FACING
        far[~(left & faces & (far <= self._within))] = np.inf
        least = int(np.argmin(far))
        if far[least] == np.inf or ends[least]:
            return None
        return int(self._owner[sides[least]]), float(self._before[sides[least]] + share[least] * length[least])


def _cut(
    cuts: dict[str, float],
    way: Road,
    number: int,
    metres: float,
    name: str,
    snap: float,
    places: dict[str, Floats],
) -> str:
    """Return the junction of a road so far along it: one of its ends, an earlier cut, or a new one."""
    if metres <= snap:
        return way.first
    if way.length - metres <= snap:
        return way.last
    for other, there in cuts.items():
        if abs(there - metres) <= snap:
            return other
    new = f"{name}|{way.name}#{number}"
    cuts[new] = metres
    places[new] = at(way.line, metres)
    return new


def _joined(
    union: Union[str], places: dict[str, Floats], known: Mapping[str, Junction]
) -> tuple[dict[str, Junction], Callable[[str], str]]:
    """Return the junctions when those that belong together are one, and what tells the name of that."""
    groups: dict[str, list[str]] = {}
    for name in places:
        groups.setdefault(union.root(name), []).append(name)
    made: dict[str, Junction] = {}
    for root, names in groups.items():
        x, y = np.mean([places[name] for name in names], axis=0).tolist()
        made[root] = Junction(x, y, any(known[name].all_way_stop for name in names if name in known))
    return made, union.root


def _pieces(way: Road, cuts: dict[str, float]) -> list[Road]:
    """Return a road in the pieces between its cuts."""
    if not cuts:
        return [way]
    stops = sorted((metres, name) for name, metres in cuts.items())
    ends = [(0.0, way.first), *stops, (way.length, way.last)]
    return [
        replace(way, name=f"{way.name}#{k}", first=a, last=b, line=stretch(way.line, begin, end), corners=None)
        for k, ((begin, a), (end, b)) in enumerate(pairwise(ends))
    ]


class _Match(NamedTuple):
    """Two pieces that may be one road, and the largest distance between them, metres."""

    apart: float
    one: int
    other: int


def _paired(pieces: list[Road], most: float) -> list[Road]:
    """Return pieces of which two between the same junctions, one each way, are one road; the nearest two first."""
    into: dict[tuple[str, str], list[int]] = {}
    matches: list[_Match] = []
    for k, piece in enumerate(pieces):
        for other in into.get((piece.last, piece.first), []):
            apart = gap(pieces[other].line, piece.line[::-1])
            if apart <= most:
                matches.append(_Match(apart, other, k))
        into.setdefault((piece.first, piece.last), []).append(k)
    made: dict[int, Road] = {}
    taken: set[int] = set()
    for _, one, other in sorted(matches):
        if not {one, other} & taken:
            taken |= {one, other}
            made[one] = _both(pieces[one], pieces[other])
    return [made.get(k, piece) for k, piece in enumerate(pieces) if k in made or k not in taken]


def _both(one: Road, other: Road) -> Road:
    """Return the road in the middle of two."""
    middle = 0.5 * (spread(one.line) + spread(other.line[::-1]))
    width = max(one.lane_width, other.lane_width)
    return Road(f"{one.name}|{other.name}", one.first, one.last, middle, 1, 1, width, pair=True)
