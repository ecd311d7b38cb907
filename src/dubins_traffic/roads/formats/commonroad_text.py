"""CommonRoad (`.xml`, version 2020a), written from road maps: two lanelets a road, from centre to centre."""

from __future__ import annotations

from math import atan2, pi
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.roads.formats.hints import hints_text
from dubins_traffic.roads.formats.turns import STOP_BEFORE, turn
from dubins_traffic.roads.formats.xml_text import document, number_text
from dubins_traffic.roads.maps.model import Road, RoadMap
from dubins_traffic.roads.maps.polylines import offset

STOP_SIGN = "R1-3"
"""STOP_4_WAY among the signs of the USA."""
SUCCESSORS = {"right": "successorsRight", "straight": "successorsStraight", "left": "successorsLeft"}


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


def write_commonroad(made: RoadMap) -> str:
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
            _lanelet(root, number, road, back, out, signs)
    for name, sign in signs.items():
        _sign(root, sign, made, name)
    for arms in out.values():
        if len(arms) > 2:
            _intersection(root, ids, arms)
    return document(root, hints_text(made, [ids.lanelet(k, False) for k in range(len(made.roads))]))


Arm = tuple[int, bool, float]
"""A lanelet out of a junction: its road, whether it goes back on it, its bearing."""


def _arms(made: RoadMap) -> dict[str, list[Arm]]:
    out: dict[str, list[Arm]] = {name: [] for name in made.junctions}
    for number, road in enumerate(made.roads):
        for back, name, line in ((False, road.first, road.line), (True, road.last, road.line[::-1])):
            out[name].append((number, back, atan2(line[1, 1] - line[0, 1], line[1, 0] - line[0, 0])))
    return out


def _lanelet(
    root: Element, number: int, road: Road, back: bool, out: dict[str, list[Arm]], signs: dict[str, str]
) -> None:
    element = SubElement(root, "lanelet", id=_Ids.lanelet(number, back))
    line = road.line[::-1] if back else road.line
    end = road.first if back else road.last
    start = road.last if back else road.first
    _bound(element, "leftBound", line, "dashed")
    _bound(element, "rightBound", offset(line, -road.lane_width), "solid")
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


def _bound(lanelet: Element, side: str, line: Floats, marking: str) -> None:
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
