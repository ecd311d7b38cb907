"""Lanelet2 (`.osm`): lanelets between linestrings, and the regulatory element `all_way_stop`, which is rule 3.

Two lanelets a road are written, from centre to centre, with a common left bound.
"""

from __future__ import annotations

from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.maps.foreign import STOP_BEFORE, WrittenFormat, hints_text, with_hints
from dubins_traffic.maps.lanelets import Lanelet, lanelet_map
from dubins_traffic.maps.model import Road, RoadMap
from dubins_traffic.maps.osm import Osm, has_lanelets, read_osm, tags, to_degrees, to_metres
from dubins_traffic.maps.polylines import offset
from dubins_traffic.maps.xml_text import document, number_text
from dubins_traffic.roads.formats.xml_root import root_name

ROADS = frozenset({"road", "highway", "play_street", "exit", ""})
"""Subtypes of lanelets that cars use."""
ORIGIN = 49.0, 9.0
"""Latitude and longitude of the origin of a map, on the middle meridian of its zone of UTM."""


class Lanelet2(WrittenFormat):
    """Maps of Lanelet2."""

    name = "lanelet2"
    suffixes = (".osm",)
    description = "Lanelet2"

    def sniff(self, text: str) -> bool:
        """Tell whether the root element is `osm` and something is a lanelet."""
        return root_name(text) == "osm" and has_lanelets(text)

    def read_map(self, text: str, file: str | None = None) -> RoadMap:
        """Return the map in a text."""
        osm = read_osm(text, file)
        stopping = _stopping(osm)
        bounded = {
            name: _bounded(osm, each)
            for name, each in osm.relations.items()
            if tags(each).get("type") == "lanelet" and tags(each).get("subtype", "") in ROADS
        }
        by_left: dict[tuple[str, bool], str] = {each.left_key: name for name, each in bounded.items()}
        by_start: dict[tuple[str, str], list[str]] = {}
        for name, each in bounded.items():
            by_start.setdefault(each.start, []).append(name)
        lanelets = {
            name: Lanelet(
                each.left,
                each.right,
                by_left.get((each.left_key[0], not each.left_key[1])),
                by_left.get(each.right_key),
                tuple(by_start.get(each.end, ())),
                name in stopping,
            )
            for name, each in bounded.items()
        }
        return with_hints(lanelet_map(lanelets), text, file).checked(file)

    def write_map(self, made: RoadMap) -> str:
        """Return the text of a map; every junction where all stop is a regulatory element `all_way_stop`."""
        text = _Text()
        centres = {name: text.node(np.array(junction[:2])) for name, junction in made.junctions.items()}
        lanelets: list[tuple[str, str]] = []
        stops: dict[str, list[tuple[str, str]]] = {name: [] for name, at in made.junctions.items() if at.all_way_stop}
        for road in made.roads:
            forward, backward = _road(text, road, centres)
            lanelets.append((forward, backward))
            for lanelet, name, line in (
                (forward, road.last, road.line[::-1]),
                (backward, road.first, road.line),
            ):
                if name in stops:
                    stops[name].append((lanelet, _stop_line(text, line, road.lane_width)))
        for pairs in stops.values():
            text.all_way_stop(pairs)
        return document(text.root(), hints_text(made, [forward for forward, _ in lanelets]))


class _Bounded(NamedTuple):
    """A lanelet: its bounds in its direction, their ways (turned or not), and the nodes where it begins and ends."""

    left: Floats
    right: Floats
    left_key: tuple[str, bool]
    right_key: tuple[str, bool]
    start: tuple[str, str]
    end: tuple[str, str]


def _bounded(osm: Osm, relation: Element) -> _Bounded:
    ways = [_side(osm, relation, role) for role in ("left", "right")]
    lines = [osm.line(osm.ways[way]) for way in ways]
    left, right = lines
    turned = [False, _span(left, right[::-1]) < _span(left, right)]
    if turned[1]:
        right = right[::-1]
    ring = np.concatenate([left, right[::-1]])
    after = np.roll(ring, -1, axis=0)
    if float((ring[:, 0] * after[:, 1] - after[:, 0] * ring[:, 1]).sum()) > 0.0:
        left, right = left[::-1], right[::-1]
        turned = [not each for each in turned]
    refs = [osm.refs(osm.ways[way])[:: -1 if back else 1] for way, back in zip(ways, turned, strict=True)]
    return _Bounded(
        left,
        right,
        (ways[0], turned[0]),
        (ways[1], turned[1]),
        (refs[0][0], refs[1][0]),
        (refs[0][-1], refs[1][-1]),
    )


def _side(osm: Osm, relation: Element, role: str) -> str:
    refs = [each.get("ref", "") for each in relation.findall("member") if each.get("role") == role]
    if len(refs) != 1 or refs[0] not in osm.ways:
        raise osm.reader.fault(f"no {role} bound", relation, refs, f"one way as {role}")
    return refs[0]


def _span(one: Floats, other: Floats) -> float:
    return float(np.hypot(*(one[0] - other[0])) + np.hypot(*(one[-1] - other[-1])))


def _stopping(osm: Osm) -> set[str]:
    """Return the lanelets at whose end everybody stops."""
    stops: set[str] = set()
    for relation in osm.relations.values():
        if tags(relation).get("subtype") == "all_way_stop":
            members = [each for each in relation.findall("member") if each.get("role") in ("yield", "lanelet")]
            stops |= {each.get("ref", "") for each in members}
    return stops


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
        element = self._element("node", {"local_x": number_text(x), "local_y": number_text(y)})
        element.set("lat", f"{latitude:.14f}")
        element.set("lon", f"{longitude:.14f}")
        self._nodes.append(element)
        return element.get("id", "")

    def way(self, nodes: list[str], **what: str) -> str:
        """Add a linestring with tags; return its id."""
        way_element = self._element("way", what)
        for k, node in enumerate(nodes):
            way_element.insert(k, Element("nd", ref=node))
        self._ways.append(way_element)
        return way_element.get("id", "")

    def lanelet(self, left: str, right: str) -> str:
        """Add a lanelet between two linestrings; return its id."""
        what = {"type": "lanelet", "subtype": "road", "location": "urban", "one_way": "yes"}
        lanelet_element = self._element("relation", what | {"participant:vehicle": "yes"})
        for k, (way, role) in enumerate(((left, "left"), (right, "right"))):
            lanelet_element.insert(k, Element("member", type="way", ref=way, role=role))
        self._relations[lanelet_element.get("id", "")] = lanelet_element
        return lanelet_element.get("id", "")

    def all_way_stop(self, pairs: list[tuple[str, str]]) -> None:
        """Add a regulatory element for lanelets, each with the line where it stops."""
        element = self._element("relation", {"type": "regulatory_element", "subtype": "all_way_stop"})
        name = element.get("id", "")
        members = [("relation", lanelet, "yield") for lanelet, _ in pairs]
        members += [("way", line, "ref_line") for _, line in pairs]
        for k, (kind, ref, role) in enumerate(members):
            element.insert(k, Element("member", type=kind, ref=ref, role=role))
        for lanelet, _ in pairs:
            self._relations[lanelet].insert(2, Element("member", type="relation", ref=name, role="regulatory_element"))
        self._relations[name] = element

    def _element(self, kind: str, what: dict[str, str]) -> Element:
        self._count += 1
        element = Element(kind, id=str(self._count), visible="true", version="1")
        for key, value in what.items():
            SubElement(element, "tag", k=key, v=value)
        return element


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
