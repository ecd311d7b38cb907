"""CommonRoad (`.xml`): lanelets, intersections, and STOP_4_WAY, which is rule 3.

Version 2020a is written: two lanelets a road, from centre to centre.
"""

from __future__ import annotations

from collections.abc import Collection
from math import atan2, pi
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.maps.foreign import STOP_BEFORE, WrittenFormat, hints_text, turn, with_hints
from dubins_traffic.maps.lanelets import Lanelet, lanelet_map
from dubins_traffic.maps.model import Road, RoadMap
from dubins_traffic.maps.polylines import offset
from dubins_traffic.maps.xml_text import Reader, document, number_text, parse, place
from dubins_traffic.roads.formats.xml_root import root_name

NO_ROAD = frozenset({"bicycleLane", "sidewalk", "crosswalk", "border", "shoulder"})
"""Types of lanelets that are not for cars."""
STOP_SIGN = "R1-3"
"""STOP_4_WAY among the signs of the USA."""
SUCCESSORS = {"right": "successorsRight", "straight": "successorsStraight", "left": "successorsLeft"}


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
        """Return the text of a scenario without cars; an intersection for each junction of three roads or more."""
        root = Element("commonRoad", commonRoadVersion="2020a", benchmarkID="USA_DubinsTraffic-1_1_T-1")
        root.attrib |= {
            "date": "2016-05-16",
            "author": "",
            "affiliation": "",
            "source": "dubins-traffic",
            "timeStepSize": "0.1",
        }
        location = SubElement(root, "location")
        for tag, value in (("geoNameId", "-999"), ("gpsLatitude", "999"), ("gpsLongitude", "999")):
            SubElement(location, tag).text = value
        SubElement(SubElement(root, "scenarioTags"), "urban")
        ids = _Ids(len(made.roads))
        out = _arms(made)
        signs = {name: ids.new() for name in made.junctions if made.junctions[name].all_way_stop}
        for number, road in enumerate(made.roads):
            for back in (False, True):
                _write_lanelet(root, number, road, back, out, signs)
        for name, sign in signs.items():
            _sign(root, sign, made, name)
        for arms in out.values():
            if len(arms) > 2:
                _intersection(root, ids, arms)
        return document(root, hints_text(made, [ids.lanelet(k, False) for k in range(len(made.roads))]))


def _lanelet(reader: Reader, element: Element, known: Collection[str], stopping: set[str]) -> Lanelet:
    left, right = (_bound(reader, element, side) for side in ("leftBound", "rightBound"))
    neighbour = {"adjacentLeft": "opposite", "adjacentRight": "same"}
    ends: dict[str, str | None] = {}
    for tag, direction in neighbour.items():
        other = element.find(tag)
        right_way = other is not None and other.get("drivingDir") == direction
        ends[tag] = _reference(reader, element, other, known) if other is not None and right_way else None
    following = tuple(_reference(reader, element, each, known) for each in element.findall("successor"))
    stops = any(each.get("ref") in stopping for each in element.iter("trafficSignRef"))
    return Lanelet(left, right, ends["adjacentLeft"], ends["adjacentRight"], following, stops)


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


class _Ids:
    """Numbers of what is in the file: lanelets 1, 2, ... by their roads, then the rest."""

    def __init__(self, roads: int) -> None:
        self._next = 2 * roads

    @staticmethod
    def lanelet(road: int, back: bool) -> str:
        return str(2 * road + 1 + back)

    def new(self) -> str:
        self._next += 1
        return str(self._next)


Arm = tuple[int, bool, float]
"""A lanelet out of a junction: its road, whether it goes back on it, its bearing."""


def _arms(made: RoadMap) -> dict[str, list[Arm]]:
    out: dict[str, list[Arm]] = {name: [] for name in made.junctions}
    for number, road in enumerate(made.roads):
        for back, name, line in ((False, road.first, road.line), (True, road.last, road.line[::-1])):
            out[name].append((number, back, atan2(line[1, 1] - line[0, 1], line[1, 0] - line[0, 0])))
    return out


def _write_lanelet(
    root: Element, number: int, road: Road, back: bool, out: dict[str, list[Arm]], signs: dict[str, str]
) -> None:
    element = SubElement(root, "lanelet", id=_Ids.lanelet(number, back))
    line = road.line[::-1] if back else road.line
    end = road.first if back else road.last
    start = road.last if back else road.first
    _write_bound(element, "leftBound", line, "dashed")
    _write_bound(element, "rightBound", offset(line, -road.lane_width), "solid")
    for arm in out[start]:
        if arm[0] != number or len(out[start]) == 1:
            SubElement(element, "predecessor", ref=_Ids.lanelet(arm[0], not arm[1]))
    for arm in out[end]:
        if arm[0] != number or len(out[end]) == 1:
            SubElement(element, "successor", ref=_Ids.lanelet(arm[0], arm[1]))
    SubElement(element, "adjacentLeft", ref=_Ids.lanelet(number, not back), drivingDir="opposite")
    if end in signs:
        stop = SubElement(element, "stopLine")
        step = (line[-2] - line[-1]) / float(np.hypot(*(line[-2] - line[-1])))
        place = line[-1] + STOP_BEFORE * step
        _point(stop, place)
        _point(stop, place + road.lane_width * np.array([-step[1], step[0]]))
        SubElement(stop, "lineMarking").text = "solid"
    SubElement(element, "laneletType").text = "urban"
    SubElement(element, "userOneWay").text = "vehicle"
    if end in signs:
        SubElement(element, "trafficSignRef", ref=signs[end])


def _write_bound(lanelet: Element, side: str, line: Floats, marking: str) -> None:
    element = SubElement(lanelet, side)
    for point in line:
        _point(element, point)
    SubElement(element, "lineMarking").text = marking


def _point(parent: Element, place: Floats) -> None:
    element = SubElement(parent, "point")
    SubElement(element, "x").text = number_text(float(place[0]))
    SubElement(element, "y").text = number_text(float(place[1]))


def _sign(root: Element, number: str, made: RoadMap, name: str) -> None:
    sign = SubElement(root, "trafficSign", id=number)
    SubElement(SubElement(sign, "trafficSignElement"), "trafficSignID").text = STOP_SIGN
    _point(SubElement(sign, "position"), np.array(made.junctions[name][:2]))
    SubElement(sign, "virtual").text = "false"


def _intersection(root: Element, ids: _Ids, arms: list[Arm]) -> None:
    """Write an intersection: for each lanelet into it those that go on to the right, straight on and to the left."""
    element = SubElement(root, "intersection", id=ids.new())
    for road, back, bearing in arms:
        incoming = SubElement(element, "incoming", id=ids.new())
        SubElement(incoming, "incomingLanelet", ref=_Ids.lanelet(road, not back))
        ways: dict[str, list[str]] = {where: [] for where in SUCCESSORS}
        for other, way_back, out in arms:
            if other != road:
                ways[turn(bearing + pi, out)].append(_Ids.lanelet(other, way_back))
        for where, tag in SUCCESSORS.items():
            for name in ways[where]:
                SubElement(incoming, tag, ref=name)
