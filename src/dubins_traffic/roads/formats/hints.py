"""What a map written by us says to be found again exactly: processing instructions that other programs pass over.

``<?dubins-traffic frame LENGTH X Y THETA?>`` says how the network lay on its lattice, and
``<?dubins-traffic corners NAME X Y RADIUS ...?>`` how a road bends. They are believed as far as the lines in the file
lie where they say (`roads.maps.ours`).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from dubins_traffic.errors import InputError
from dubins_traffic.roads.maps.model import RoadMap
from dubins_traffic.roads.maps.ours import corners_text, read_corners, read_frame

TARGET = "dubins-traffic"
_HINT = re.compile(rf"<\?{TARGET} (\w+) ([^?>]*)\?>")
_ROOT = re.compile(r"<[A-Za-z_]")


def hints_text(made: RoadMap, names: Sequence[str]) -> str:
    """Return the instructions for a map whose roads are called so in the file; names are without blanks."""
    if made.frame is None:
        return ""
    lines = [f"<?{TARGET} frame {made.frame.text()}?>"]
    for name, road in zip(names, made.roads, strict=True):
        if road.corners:
            lines.append(f"<?{TARGET} corners {name} {corners_text(road.corners)}?>")
    return "\n".join(lines) + "\n"


def with_hints(found: RoadMap, text: str, file: str | None) -> RoadMap:
    """Return a map with what the instructions before the root of its text say; InputError if they are broken."""
    root = _ROOT.search(text)
    frame = found.frame
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
        return found
    roads = [
        replace(road, corners=read_corners(corners[road.name], file)) if road.name in corners else road
        for road in found.roads
    ]
    return replace(found, roads=tuple(roads), frame=frame)
