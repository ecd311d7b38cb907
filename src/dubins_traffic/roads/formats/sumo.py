"""Road networks of SUMO (`.net.xml`), read as road maps."""

from __future__ import annotations

from xml.etree.ElementTree import Element

import numpy as np

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.roads.formats.foreign import WrittenFormat
from dubins_traffic.roads.formats.hints import with_hints
from dubins_traffic.roads.formats.sumo_net import write_net
from dubins_traffic.roads.formats.xml_text import Reader, parse, place, root_name
from dubins_traffic.roads.maps.model import Junction, RoadMap
from dubins_traffic.roads.maps.pairing import OneWay, paired

LANE_WIDTH = 3.2
"""Width of a lane that gives none."""
STOP = "allway_stop"
CARS = frozenset({"passenger"})
ROAD_TRAFFIC = frozenset({"bus", "coach", "delivery", "taxi", "truck", "trailer"})


class SumoNet(WrittenFormat):
    """Road networks of SUMO."""

    name = "sumo"
    suffixes = (".net.xml",)
    description = "road network of SUMO"

    def sniff(self, text: str) -> bool:
        """Tell whether the root element is `net`."""
        return root_name(text) == "net"

    def read_map(self, text: str, file: str | None = None) -> RoadMap:
        """Return the map in a text."""
        return read_net(text, file)

    def write_map(self, made: RoadMap) -> str:
        """Return the text of a map."""
        return write_net(made)


def read_net(text: str, file: str | None = None) -> RoadMap:
    """Return the map in a SUMO network; InputError if the text is broken."""
    root = parse(text, "net", file)
    reader = Reader(file)
    found = reader.unique(each for each in root.iter("junction") if each.get("type") != "internal")
    junctions = {
        name: Junction(reader.number(each, "x"), reader.number(each, "y"), each.get("type") == STOP)
        for name, each in found.items()
    }
    edges = reader.unique(each for each in root.iter("edge") if each.get("function", "normal") == "normal")
    directions = [_direction(reader, each, junctions) for each in edges.values()]
    made = RoadMap(junctions, paired([one for one in directions if one.lanes]))
    return with_hints(made, text, file).checked(file)


def _direction(reader: Reader, edge: Element, junctions: dict[str, Junction]) -> OneWay:
    first, last = reader.text(edge, "from"), reader.text(edge, "to")
    for name, end in (("from", first), ("to", last)):
        if end not in junctions:
            field = f"{place(edge)}.{name}"
            raise InputError(
                "no such junction", file=reader.file, field=field, value=end, expected="a junction's id"
            )
    every = edge.findall("lane")
    if not every:
        raise reader.fault("has no lanes", edge, edge.get("id"), "at least one <lane>")
    cars = [lane for lane in every if _lets(lane, CARS)]
    lanes = cars or [lane for lane in every if _lets(lane, ROAD_TRAFFIC)]
    widths = [reader.number(lane, "width", LANE_WIDTH) for lane in lanes]
    if any(not width > 0.0 for width in widths):
        raise reader.fault("not the width of a lane", edge, min(widths), "metres above 0")
    width = max(widths, default=LANE_WIDTH)
    shape = edge.get("shape")
    line = (
        read_shape(reader, edge, shape) if shape else np.array([junctions[end][:2] for end in (first, last)])
    )
    return OneWay(str(edge.get("id")), first, last, line, len(lanes), width, closed=not cars)


def _lets(lane: Element, classes: frozenset[str]) -> bool:
    """Whether a lane lets one of some classes of vehicles in."""
    allow, disallow = lane.get("allow"), lane.get("disallow")
    if allow is not None:
        return not (classes | {"all"}).isdisjoint(allow.split())
    return disallow is None or not ({"all"} & set(disallow.split()) or classes <= set(disallow.split()))


def read_shape(reader: Reader, element: Element, text: str) -> Floats:
    """Return the points of a shape ``x,y x,y,z ...`` in the plane, (N, 2)."""
    field = f"{place(element)}.shape"
    rows: list[tuple[float, float]] = []
    for point in text.split():
        parts = point.split(",")
        if len(parts) not in (2, 3):
            raise InputError(
                "not a point", file=reader.file, field=field, value=point, expected="x,y or x,y,z"
            )
        rows.append((reader.parsed(parts[0], field), reader.parsed(parts[1], field)))
    if len(rows) < 2:
        raise InputError(
            "not a line", file=reader.file, field=field, value=text, expected="two points or more"
        )
    return np.array(rows)
