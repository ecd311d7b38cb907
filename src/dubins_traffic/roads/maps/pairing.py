"""Two directions of one road, which many formats give as two: found by their ends and lines."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.roads.maps.model import Corner, Road
from dubins_traffic.roads.maps.polylines import along, at

APART = 1.0
"""Most metres between the lines of two directions that are one road."""
_SAMPLES = 33


class OneWay(NamedTuple):
    """One direction of a road: its line runs between the two directions, from `first` to `last`."""

    name: str
    first: str
    last: str
    line: Floats
    lanes: int
    lane_width: float
    corners: tuple[Corner, ...] | None = None
    closed: bool = False


def paired(directions: list[OneWay]) -> list[Road]:
    """Return the roads of directions; of several that could be the other way of one the nearest is."""
    waiting: dict[tuple[str, str], list[OneWay]] = {}
    roads: list[Road] = []
    for one in directions:
        back = waiting.get((one.last, one.first), [])
        gaps = [_gap(one.line, other.line[::-1]) for other in back]
        if gaps and min(gaps) <= APART:
            roads.append(_joined(back.pop(gaps.index(min(gaps))), one))
        else:
            waiting.setdefault((one.first, one.last), []).append(one)
    lonely = [one for group in waiting.values() for one in group]
    return roads + [
        Road(one.name, one.first, one.last, one.line, one.lanes, 0, one.lane_width, one.corners, one.closed)
        for one in lonely
    ]


def _joined(one: OneWay, back: OneWay) -> Road:
    width = max(one.lane_width, back.lane_width)
    closed = one.closed or back.closed
    return Road(one.name, one.first, one.last, one.line, one.lanes, back.lanes, width, one.corners, closed)


def _gap(one: Floats, other: Floats) -> float:
    """Return the largest distance of two lines at equal shares of their lengths."""
    step = _spread(one) - _spread(other)
    return float(np.sqrt((step * step).sum(axis=1)).max())


def _spread(line: Floats) -> Floats:
    """Return points at equal shares of a line's length."""
    return at(line, np.linspace(0.0, float(along(line)[-1]), _SAMPLES))
