"""CommonRoad (`.xml`): lanelets, intersections, and STOP_4_WAY, which is rule 3."""

from __future__ import annotations

from collections.abc import Collection
from xml.etree.ElementTree import Element

import numpy as np

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.roads.formats.commonroad_text import STOP_SIGN, write_commonroad
from dubins_traffic.roads.formats.foreign import WrittenFormat
from dubins_traffic.roads.formats.hints import with_hints
from dubins_traffic.roads.formats.xml_text import Reader, parse, place, root_name
from dubins_traffic.roads.maps.lanelets import Lanelet, lanelet_map
from dubins_traffic.roads.maps.model import RoadMap

NO_ROAD = frozenset({"bicycleLane", "sidewalk", "crosswalk", "border", "shoulder"})
"""Types of lanelets that are not for cars."""


class CommonRoad(WrittenFormat):
    """Scenarios of CommonRoad, version 2018b and 2020a: their lanelets."""

    name = "commonroad"
    suffixes = (".xml",)
    description = "CommonRoad scenario"

    def sniff(self, text: str) -> bool:
        """Tell whether the root element is `commonRoad`."""
        return root_name(text) == "commonRoad"

    def read_map(self, text: str, file: str | None = None) -> RoadMap:
        """Return the map in a text; what else a scenario holds is passed over."""
        root = parse(text, "commonRoad", file)
        reader = Reader(file)
        elements = reader.unique(iter(root.findall("lanelet")))
        signs = reader.unique(iter(root.findall("trafficSign")))
        stopping = {
            name
            for name, sign in signs.items()
            if any((each.text or "").strip() == STOP_SIGN for each in sign.iter("trafficSignID"))
        }
        lanelets = {
            name: _lanelet(reader, each, elements.keys(), stopping)
            for name, each in elements.items()
            if NO_ROAD.isdisjoint((kind.text or "").strip() for kind in each.findall("laneletType"))
        }
        return with_hints(lanelet_map(lanelets), text, file).checked(file)

    def write_map(self, made: RoadMap) -> str:
        """Return the text of a map."""
        return write_commonroad(made)


def _lanelet(reader: Reader, element: Element, known: Collection[str], stopping: set[str]) -> Lanelet:
    left, right = (_bound(reader, element, side) for side in ("leftBound", "rightBound"))
    neighbour = {"adjacentLeft": "opposite", "adjacentRight": "same"}
    found: dict[str, str | None] = {}
    for tag, direction in neighbour.items():
        other = element.find(tag)
        right_way = other is not None and other.get("drivingDir") == direction
        found[tag] = _reference(reader, element, other, known) if other is not None and right_way else None
    following = tuple(_reference(reader, element, each, known) for each in element.findall("successor"))
    stops = any(each.get("ref") in stopping for each in element.iter("trafficSignRef"))
    return Lanelet(left, right, found["adjacentLeft"], found["adjacentRight"], following, stops)


def _reference(reader: Reader, lanelet: Element, element: Element, known: Collection[str]) -> str:
    name = reader.text(element, "ref")
    if name not in known:
        problem = f"{element.tag} is no lanelet"
        raise reader.fault(problem, lanelet, name, "the id of a lanelet")
    return name


def _bound(reader: Reader, lanelet: Element, side: str) -> Floats:
    field = f"{place(lanelet)}.{side}"
    points = [
        [reader.parsed(reader.child(each, axis).text or "", field) for axis in ("x", "y")]
        for each in reader.child(lanelet, side).findall("point")
    ]
    if len(points) < 2:
        raise reader.fault(f"{side} is no line", lanelet, len(points), "two points or more")
    return np.array(points)
