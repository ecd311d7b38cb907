"""A road map of any format: junctions, and roads between them. Formats read into it and write from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats

Corner = tuple[float, float, float]
"""A corner of a control polygon: x, y and the radius of the arc that rounds it, metres."""
LARGEST = 1e7
"""Farthest that a coordinate of a map may lie from its origin, metres."""
MOST_ROADS = 50_000
MOST_POINTS = 2_000_000
"""Most points of all roads of a map together."""


class Junction(NamedTuple):
    """Where roads end.

    Attributes
    ----------
    x, y : float
        Metres.
    all_way_stop : bool
        Whether the file says that everybody stops here, which is rule 3 of the road.
    """

    x: float
    y: float
    all_way_stop: bool = False


@dataclass(frozen=True, slots=True)
class Road:
    """A road between two junctions.

    Parameters
    ----------
    name : str
        Its name in the file.
    first, last : str
        The junctions at which it begins and ends.
    line : array (N, 2)
        The line between the two directions, from `first` to `last`, metres; a polyline, or points of a curve.
    forward, backward : int
        Lanes for cars along `line` and against it.
    lane_width : float
        Width of a lane, metres.
    corners : tuple of (x, y, radius), optional
        The control polygon between both ends, where the file gives the road exactly as lines and tangent arcs.
    closed : bool
        Whether it is not for cars, but for other traffic of the road, such as buses; lanes are those of this.
    pair : bool
        Whether it stands for two one-way roads beside each other (`maps.pairs`).
    """

    name: str
    first: str
    last: str
    line: Floats
    forward: int
    backward: int
    lane_width: float
    corners: tuple[Corner, ...] | None = None
    closed: bool = False
    pair: bool = False

    @property
    def length(self) -> float:
        """Metres along `line`."""
        return polyline_length(self.line)

    @property
    def is_plain(self) -> bool:
        """Whether it has one lane in each direction, as all roads of a network of ours."""
        return self.forward == 1 and self.backward == 1 and not self.closed


class Frame(NamedTuple):
    """How a network of ours lay on its lattice, so that it is found again: metres of a unit, and the rigid motion."""

    length: float
    x: float
    y: float
    theta: float

    def text(self) -> str:
        """Return the four numbers as a text."""
        return " ".join(repr(float(number)) for number in self)


@dataclass(frozen=True, slots=True)
class RoadMap:
    """Junctions by name, and roads between them, metres of the file; `frame` where it was a network of ours."""

    junctions: Mapping[str, Junction]
    roads: Sequence[Road]
    frame: Frame | None = None

    def checked(self, file: str | None = None) -> RoadMap:
        """Return this map if it makes sense.

        Raises
        ------
        InputError
            If it has no road or too many, a coordinate is not finite or too large, or a road ends at no junction.
        """
        if not self.roads:
            raise InputError("no roads", file=file, expected="at least one road for cars")
        points = sum(len(road.line) for road in self.roads)
        for number, most, what in ((len(self.roads), MOST_ROADS, "roads"), (points, MOST_POINTS, "points")):
            if number > most:
                raise InputError(f"too many {what}", file=file, value=number, expected=f"at most {most}")
        for name, junction in self.junctions.items():
            if not _is_place(np.array(junction[:2])):
                raise InputError(
                    "not a place", file=file, field=f"junction {name}", value=junction[:2], expected=_PLACE
                )
        for road in self.roads:
            self._check_road(road, file)
        return self

    def _check_road(self, road: Road, file: str | None) -> None:
        field = f"road {road.name}"
        for end in (road.first, road.last):
            if end not in self.junctions:
                raise InputError("ends at no junction", file=file, field=field, value=end, expected="a junction")
        if len(road.line) < 2 or not _is_place(road.line):
            expected = f"two points or more, each with {_PLACE}"
            raise InputError("not a line", file=file, field=field, expected=expected)
        if not 1e-3 <= road.lane_width <= 1e3:
            expected = "metres in [0.001, 1000]"
            raise InputError(
                "not the width of a lane", file=file, field=field, value=road.lane_width, expected=expected
            )


def map_of(junctions: Mapping[str, Junction], roads: Sequence[Road]) -> RoadMap:
    """Return the map of roads, with those of some junctions at which they end."""
    ends = {end for road in roads for end in (road.first, road.last)}
    return RoadMap({name: place for name, place in junctions.items() if name in ends}, roads)


_PLACE = f"finite coordinates in [-{LARGEST:g}, {LARGEST:g}]"


def _is_place(points: Floats) -> bool:
    return bool(np.isfinite(points).all() and (np.abs(points) <= LARGEST).all())


def polyline_length(line: Floats) -> float:
    """Return the metres along a polyline (N, 2)."""
    step = np.diff(line, axis=0)
    return float(np.sqrt((step * step).sum(axis=1)).sum())
