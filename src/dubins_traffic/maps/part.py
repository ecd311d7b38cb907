"""The part of a map that is asked for: in a rectangle, or around a junction. It is the map that is reduced then."""

from __future__ import annotations

from dataclasses import dataclass
from difflib import get_close_matches
from typing import Final

import numpy as np
import numpy.typing as npt

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.maps.losses import Losses, NothingHeldError
from dubins_traffic.maps.model import RoadMap, map_of
from dubins_traffic.roads.network import RoadNetwork

CLIP: Final = "--clip"
AROUND: Final = "--around"
BOX: Final = "X0,Y0,X1,Y1, metres of the map, with X0 < X1 and Y0 < Y1"


@dataclass(frozen=True, slots=True)
class Clip:
    """A rectangle of a map, metres of it."""

    x0: float
    y0: float
    x1: float
    y1: float

    @classmethod
    def read(cls, text: str) -> Clip:
        """Return the rectangle that a text names as ``X0,Y0,X1,Y1``; InputError if it names none."""
        try:
            x0, y0, x1, y1 = (float(number) for number in text.split(","))
        except ValueError:
            raise InputError("not a rectangle", file=CLIP, value=text, expected=BOX) from None
        if not (np.isfinite([x0, y0, x1, y1]).all() and x0 < x1 and y0 < y1):
            raise InputError("not a rectangle", file=CLIP, value=text, expected=BOX)
        return cls(x0, y0, x1, y1)

    def holds(self, points: Floats, road_map: RoadMap, file: str | None) -> npt.NDArray[np.bool_]:  # noqa: ARG002  # as `Around`
        """Tell of points (N, 2) of a map which are in the rectangle."""
        x, y = points[:, 0], points[:, 1]
        inside: npt.NDArray[np.bool_] = (self.x0 <= x) & (x <= self.x1) & (self.y0 <= y) & (y <= self.y1)
        return inside

    def __str__(self) -> str:
        return f"{CLIP} {self.x0:g},{self.y0:g},{self.x1:g},{self.y1:g}"


@dataclass(frozen=True, slots=True)
class Around:
    """What is at most `radius` metres from a junction of a map."""

    junction: str
    radius: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.radius) and self.radius > 0.0):
            raise InputError("not a radius", file=AROUND, value=self.radius, expected="metres of the map, above 0")

    def holds(self, points: Floats, road_map: RoadMap, file: str | None) -> npt.NDArray[np.bool_]:
        """Tell of points (N, 2) of a map which are so near; InputError if the map has no such junction."""
        if self.junction not in road_map.junctions:
            like = get_close_matches(self.junction, road_map.junctions, 3, 0.0) or list(road_map.junctions)[:3]
            raise InputError(
                "no such junction", file=file, field=AROUND, value=self.junction,
                expected=f"one of the map's {len(road_map.junctions)}, such as {', '.join(like)}",
            )  # fmt: skip
        x, y, _ = road_map.junctions[self.junction]
        far: Floats = np.hypot(points[:, 0] - x, points[:, 1] - y)
        return far <= self.radius

    def __str__(self) -> str:
        return f"{AROUND} {self.junction} {self.radius:g}"


Part = Clip | Around


def part_of(road_map: RoadMap, part: Part, file: str | None = None) -> RoadMap:
    """Return the roads of a map that lie wholly in a part of it, and their junctions.

    Raises
    ------
    InputError
        If no road does, or the junction is none of the map.
    """
    roads = tuple(road for road in road_map.roads if part.holds(road.line, road_map, file).all())
    if not roads:
        raise InputError(
            "no road lies wholly in this part", file=file, field=str(part),
            expected=f"a part that holds some of the map's {len(road_map.roads)} roads",
        )  # fmt: skip
    return map_of(road_map.junctions, roads)


class NoLoopError(NothingHeldError):
    """Of a part of a map no loop is left, so all its roads end dead; `losses` are those of its roads."""

    def __init__(self, losses: Losses, network: RoadNetwork, part: Part, file: str | None) -> None:
        self.losses = losses
        held = f"{len(network.segments)} segments between {len(network.intersections)} intersections"
        InputError.__init__(
            self, "no loop is left of the map", file=file, field=str(part), value=held,
            expected="a larger part, or another",
        )  # fmt: skip


def require_loop(network: RoadNetwork, losses: Losses, part: Part, file: str | None = None) -> None:
    """Refuse the network of a part of a map that has no loop: NoLoopError."""
    if len(network.segments) < len(network.intersections):
        raise NoLoopError(losses, network, part, file)
