"""Lanelet2 (`.osm`), written from road maps: two lanelets a road, from centre to centre, with a common left bound."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

import numpy as np

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.roads.formats.hints import hints_text
from dubins_traffic.roads.formats.turns import STOP_BEFORE
from dubins_traffic.roads.formats.xml_text import document, number_text
from dubins_traffic.roads.maps.mercator import to_degrees, to_metres
from dubins_traffic.roads.maps.model import Road, RoadMap
from dubins_traffic.roads.maps.polylines import offset

ORIGIN = 49.0, 9.0
"""Latitude and longitude of the origin of a map, on the middle meridian of its zone of UTM."""


def write_lanelet2(made: RoadMap) -> str:
    """Return the text of a map; every junction where all stop is a regulatory element `all_way_stop`."""
    text = _Text()
    centres = {name: text.node(np.array(junction[:2])) for name, junction in made.junctions.items()}
    lanelets: list[tuple[str, str]] = []
    stops: dict[str, list[tuple[str, str]]] = {
        name: [] for name, at in made.junctions.items() if at.all_way_stop
    }
    for road in made.roads:
        forward, backward = _road(text, road, centres)
        lanelets.append((forward, backward))
        for lanelet, name, line in ((forward, road.last, road.line[::-1]), (backward, road.first, road.line)):
            if name in stops:
                stops[name].append((lanelet, _stop_line(text, line, road.lane_width)))
    for pairs in stops.values():
        text.all_way_stop(pairs)
    return document(text.root(), hints_text(made, [forward for forward, _ in lanelets]))


class _Text:
    """Collects nodes, ways and relations; ids are counted from 1."""

    def __init__(self) -> None:
        self._count = 0
        self._nodes: list[Element] = []
        self._ways: list[Element] = []
        self._relations: dict[str, Element] = {}
        self._north = to_metres(*ORIGIN, ORIGIN[1])[1]

    def root(self) -> Element:
        """Return everything."""
        root = Element("osm", version="0.6", generator="dubins-traffic")
        root.extend([*self._nodes, *self._ways, *self._relations.values()])
        return root

    def node(self, place: Floats) -> str:
        """Add a node; return its id."""
        x, y = float(place[0]), float(place[1])
        latitude, longitude = to_degrees(x, y + self._north, ORIGIN[1])
        own = self._element("node", {"local_x": number_text(x), "local_y": number_text(y)})
        own.set("lat", f"{latitude:.14f}")
        own.set("lon", f"{longitude:.14f}")
        self._nodes.append(own)
        return own.get("id", "")

    def way(self, nodes: list[str], **what: str) -> str:
        """Add a linestring with tags; return its id."""
        own = self._element("way", what)
        for k, node in enumerate(nodes):
            own.insert(k, Element("nd", ref=node))
        self._ways.append(own)
        return own.get("id", "")

    def lanelet(self, left: str, right: str) -> str:
        """Add a lanelet between two linestrings; return its id."""
        what = {"type": "lanelet", "subtype": "road", "location": "urban", "one_way": "yes"}
        own = self._element("relation", what | {"participant:vehicle": "yes"})
        for k, (way, role) in enumerate(((left, "left"), (right, "right"))):
            own.insert(k, Element("member", type="way", ref=way, role=role))
        self._relations[own.get("id", "")] = own
        return own.get("id", "")

    def all_way_stop(self, pairs: list[tuple[str, str]]) -> None:
        """Add a regulatory element for lanelets, each with the line where it stops."""
        own = self._element("relation", {"type": "regulatory_element", "subtype": "all_way_stop"})
        name = own.get("id", "")
        members = [("relation", lanelet, "yield") for lanelet, _ in pairs]
        members += [("way", line, "ref_line") for _, line in pairs]
        for k, (kind, ref, role) in enumerate(members):
            own.insert(k, Element("member", type=kind, ref=ref, role=role))
        for lanelet, _ in pairs:
            self._relations[lanelet].insert(
                2, Element("member", type="relation", ref=name, role="regulatory_element")
            )
        self._relations[name] = own

    def _element(self, kind: str, what: dict[str, str]) -> Element:
        self._count += 1
        own = Element(kind, id=str(self._count), visible="true", version="1")
        for key, value in what.items():
            SubElement(own, "tag", k=key, v=value)
        return own


def _road(text: _Text, road: Road, centres: dict[str, str]) -> tuple[str, str]:
    """Add a road; return its lanelets along its line and against it."""
    inner = [text.node(place) for place in road.line[1:-1]]
    middle = text.way([centres[road.first], *inner, centres[road.last]], type="line_thin", subtype="dashed")
    sides = [
        text.way([text.node(place) for place in offset(road.line, left)], type="line_thin", subtype="solid")
        for left in (-road.lane_width, road.lane_width)
    ]
    return text.lanelet(middle, sides[0]), text.lanelet(middle, sides[1])


def _stop_line(text: _Text, line: Floats, width: float) -> str:
    """Add the line where one stops on the way to the beginning of `line`; return its id."""
    step = (line[1] - line[0]) / float(np.hypot(*(line[1] - line[0])))
    place = line[0] + STOP_BEFORE * step
    across = place + width * np.array([-step[1], step[0]])
    return text.way([text.node(place), text.node(across)], type="stop_line")
