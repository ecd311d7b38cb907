"""Lanelets, as Lanelet2 and CommonRoad have them, as a road map: pairs with a common bound are roads."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.maps.junctions import End, Union, joined_where_equal, junctions_of
from dubins_traffic.maps.model import Road, RoadMap
from dubins_traffic.maps.polylines import along, at, cleaned, dense, to_segments

LONGEST_LINK = 60.0
"""A lanelet between two others that is longer than this is a road, not a way through a junction, metres."""
LANE_WIDTH = 3.5
LARGEST_WIDTH = 20.0


class Lanelet(NamedTuple):
    """A lane with its bounds in its direction.

    Attributes
    ----------
    left, right : array (N, 2)
        The bounds, metres.
    opposite : str, optional
        The lanelet in the other direction on the other side of the left bound.
    beside : str, optional
        The lanelet in the same direction to the right.
    following : tuple of str
        Those that go on where it ends.
    stops : bool
        Whether everybody stops at the junction where it ends.
    """

    left: Floats
    right: Floats
    opposite: str | None
    beside: str | None
    following: tuple[str, ...]
    stops: bool = False


def lanelet_map(lanelets: Mapping[str, Lanelet]) -> RoadMap:
    """Return the road map of lanelets: roads have the name of their first lanelet."""
    forward = _roads(lanelets)
    lines = {name: _line(lanelets[name]) for name in forward}
    ends: dict[str, tuple[End, End]] = {}
    for name, back in forward.items():
        ends[name] = End(name, True), End(name, False)
        if back is not None:
            ends[back] = End(name, False), End(name, True)
    union = Union[End]()
    _join(union, lanelets, ends)
    joined_where_equal(union, lines)
    stops = [ends[name][1] for name, lanelet in lanelets.items() if lanelet.stops and name in ends]
    junctions, names = junctions_of(union, lines, stops)
    roads = [
        Road(
            name,
            names[End(name, True)],
            names[End(name, False)],
            lines[name],
            _lanes(lanelets, name),
            0 if back is None else _lanes(lanelets, back),
            _width(lanelets[name]),
        )
        for name, back in forward.items()
    ]
    return RoadMap(junctions, tuple(roads))


def _roads(lanelets: Mapping[str, Lanelet]) -> dict[str, str | None]:
    """Return the lanelets that stand for roads, and what leads back on the same road, None for a one-way road."""
    beside = {each.beside for each in lanelets.values() if each.beside is not None}
    before: dict[str, int] = {}
    for each in lanelets.values():
        for name in each.following:
            before[name] = before.get(name, 0) + 1
    of_lanelet: dict[str, str | None] = {}
    taken: set[str] = set()
    for name, each in lanelets.items():
        if name in taken or name in beside:
            continue
        back = each.opposite
        if back is not None and back in lanelets and back not in taken:
            of_lanelet[name] = back
            taken |= {name, back}
        elif not (each.following and before.get(name) and float(along(each.left)[-1]) <= LONGEST_LINK):
            of_lanelet[name] = None
            taken.add(name)
    return of_lanelet


def _join(union: Union[End], lanelets: Mapping[str, Lanelet], ends: Mapping[str, tuple[End, End]]) -> None:
    """Join where one road ends with where the next begins, directly or by lanelets through a junction."""
    for name, (_, end) in ends.items():
        waiting = list(_inner(lanelets, name))
        seen: set[str] = set()
        while waiting:
            following = waiting.pop()
            if following in ends:
                union.join((end, ends[following][0]))
            elif following in lanelets and following not in seen:
                seen.add(following)
                waiting += lanelets[following].following


def _inner(lanelets: Mapping[str, Lanelet], name: str) -> Iterable[str]:
    """Yield what follows a lanelet or those beside it."""
    seen: set[str] = set()
    each: str | None = name
    while each is not None and each in lanelets and each not in seen:
        seen.add(each)
        yield from lanelets[each].following
        each = lanelets[each].beside


def _lanes(lanelets: Mapping[str, Lanelet], name: str) -> int:
    seen: set[str] = set()
    each: str | None = name
    while each is not None and each in lanelets and each not in seen:
        seen.add(each)
        each = lanelets[each].beside
    return len(seen)


def _line(lanelet: Lanelet) -> Floats:
    """Return the line of a road: the common bound of both directions, or the middle of one lane."""
    if lanelet.opposite is not None:
        return cleaned(lanelet.left)
    count = max(len(lanelet.left), len(lanelet.right))
    share = np.linspace(0.0, 1.0, count)
    sides = [at(line, share * float(along(line)[-1])) for line in (lanelet.left, lanelet.right)]
    return cleaned(0.5 * (sides[0] + sides[1]))


def _width(lanelet: Lanelet) -> float:
    """Return the usual distance of the bounds."""
    away = to_segments(dense(lanelet.left, max(0.1, 0.05 * float(along(lanelet.left)[-1]))), lanelet.right)
    middle = float(np.median(away))
    return round(middle, 6) if 1e-3 < middle < LARGEST_WIDTH else LANE_WIDTH
