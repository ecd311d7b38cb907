"""What the formats of other programs have in common: they are read into a road map, which is reduced to a network.

A map written by us says, to be found again exactly, what other programs pass over, in processing instructions:
``<?dubins-traffic frame LENGTH X Y THETA?>`` says how the network lay on its lattice, and
``<?dubins-traffic corners NAME X Y RADIUS ...?>`` how a road bends. They are believed as far as the lines in the file
lie where they say (`maps.from_rnd`).
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import pi
from typing import Any, Literal

from dubins_traffic.errors import InputError
from dubins_traffic.maps.from_rnd import corners_text, read_corners, read_frame, road_map
from dubins_traffic.maps.model import RoadMap
from dubins_traffic.maps.part import Part, part_of
from dubins_traffic.maps.reduction import Reduction, reduction
from dubins_traffic.maps.settings import ImportSettings

TARGET = "dubins-traffic"
_HINT = re.compile(rf"<\?{TARGET} (\w+) ([^?>]*)\?>")
_ROOT = re.compile(r"<[A-Za-z_]")
STOP_BEFORE = 1.0
"""Metres from a junction to the lines where one stops: its radius R."""
STRAIGHT_ON = pi / 4
"""Roads that go on within this angle go straight on."""


class ForeignFormat(ABC):
    """A map format of another program: what it reads is reduced to what a network can hold."""

    name: str
    suffixes: tuple[str, ...]
    description: str

    @abstractmethod
    def sniff(self, text: str) -> bool:
        """Tell whether a text is of this format, from its beginning."""

    @abstractmethod
    def read_map(self, text: str, file: str | None = None) -> RoadMap:
        """Return the map in a text; InputError if it is broken."""

    def read(self, text: str, file: str | None = None) -> Mapping[str, Any]:
        """Return the RND document of the network to which a text is reduced, with usual `ImportSettings`."""
        return self.reduced(text, file).document

    def reduced(
        self,
        text: str,
        file: str | None = None,
        settings: ImportSettings | None = None,
        *,
        own_lanes: bool = False,
        part: Part | None = None,
    ) -> Reduction:
        """Return the network to which a text, or a part of its map, is reduced, and what was lost.

        See `maps.reduction.reduction`.
        """
        drawn = self.read_map(text, file)
        drawn = drawn if part is None else part_of(drawn, part, file)
        return reduction(drawn, settings, file, own_lanes=own_lanes)


class WrittenFormat(ForeignFormat):
    """A map format of another program that can be written, too."""

    @abstractmethod
    def write_map(self, made: RoadMap) -> str:
        """Return the text of a map whose roads have one lane in each direction."""

    def write(self, document: Mapping[str, Any]) -> str:
        """Return the text of an RND document."""
        return self.write_map(road_map(document))


def hints_text(made: RoadMap, names: Sequence[str]) -> str:
    """Return the instructions for a map whose roads are called so in the file; names are without blanks."""
    if made.frame is None:
        return ""
    lines = [f"<?{TARGET} frame {made.frame.text()}?>"]
    for name, road in zip(names, made.roads, strict=True):
        if road.corners:
            lines.append(f"<?{TARGET} corners {name} {corners_text(road.corners)}?>")
    return "\n".join(lines) + "\n"


def with_hints(road_map: RoadMap, text: str, file: str | None) -> RoadMap:
    """Return a map with what the instructions before the root of its text say; InputError if they are broken."""
    root = _ROOT.search(text)
    frame = road_map.frame
    corners: dict[str, str] = {}
    for kind, value in _HINT.findall(text[: root.start()] if root else ""):
        if kind == "frame":
            frame = read_frame(value, file)
        elif kind == "corners":
            name, _, rest = value.partition(" ")
            corners[name] = rest
        else:
            raise InputError("unknown instruction", file=file, value=kind, expected="frame or corners")
    if frame is None:
        return road_map
    roads = [
        replace(road, corners=read_corners(corners[road.name], file)) if road.name in corners else road
        for road in road_map.roads
    ]
    return replace(road_map, roads=tuple(roads), frame=frame)


def turn(into: float, out: float) -> Literal["straight", "left", "right"]:
    """Return where a lane with the bearing `out` leads from one with the bearing `into`, both radians."""
    angle = (out - into + pi) % (2.0 * pi) - pi
    if abs(angle) < STRAIGHT_ON:
        return "straight"
    return "left" if angle > 0.0 else "right"
