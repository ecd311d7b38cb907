"""Road networks of SUMO (`.net.xml`), written from road maps: lanes from centre to centre, none in junctions."""

from __future__ import annotations

from math import atan2, cos, pi, sin
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.roads.formats.hints import hints_text
from dubins_traffic.roads.formats.turns import turn
from dubins_traffic.roads.formats.xml_text import document, number_text
from dubins_traffic.roads.maps.model import Road, RoadMap
from dubins_traffic.roads.maps.polylines import offset, true_length

SPEED = 1.0
DIRECTIONS = {"straight": "s", "left": "l", "right": "r"}


class Lane(NamedTuple):
    """A lane: the name of its edge, its road, the junctions where it begins and ends, and its bearings there."""

    edge: str
    road: int
    first: str
    last: str
    out: float
    into: float


def write_net(made: RoadMap) -> str:
    """Return the text of a SUMO network; each road becomes two edges, ``name`` and ``-name``."""
    places = np.concatenate([road.line for road in made.roads])
    box = ",".join(number_text(float(each)) for each in (*places.min(axis=0), *places.max(axis=0)))
    root = Element("net", version="1.20", junctionCornerDetail="5", limitTurnSpeed="5.50")
    SubElement(root, "location", netOffset="0.00,0.00", convBoundary=box, origBoundary=box, projParameter="!")
    lanes: list[Lane] = []
    for number, road in enumerate(made.roads):
        lanes += _lanes(number, road)
        _edge(root, lanes[-2], road, road.line)
        _edge(root, lanes[-1], road, road.line[::-1])
    out: dict[str, list[Lane]] = {name: [] for name in made.junctions}
    into: dict[str, list[Lane]] = {name: [] for name in made.junctions}
    for lane in lanes:
        out[lane.first].append(lane)
        into[lane.last].append(lane)
    links = {name: _links(into[name], out[name]) for name in made.junctions}
    for name in made.junctions:
        _junction(root, name, made, into[name], links[name])
    for name, own in links.items():
        _connections(root, own, made.junctions[name].all_way_stop)
    return document(root, hints_text(made, [road.name for road in made.roads]))


def _lanes(number: int, road: Road) -> tuple[Lane, Lane]:
    begin, end = _bearing(road.line), _bearing(road.line[::-1])
    there = Lane(road.name, number, road.first, road.last, begin, end + pi)
    return there, Lane(f"-{road.name}", number, road.last, road.first, end, begin + pi)


def _bearing(line: Floats) -> float:
    return atan2(line[1, 1] - line[0, 1], line[1, 0] - line[0, 0])


def _edge(root: Element, lane: Lane, road: Road, line: Floats) -> None:
    edge = SubElement(root, "edge", {"id": lane.edge, "from": lane.first, "to": lane.last, "priority": "1"})
    if len(line) > 2:
        edge.set("shape", shape_text(line))
    # Corners stand in the order of the road, whichever way the edge runs.
    length = true_length(road.line[[0, -1]], road.corners or ())
    row = SubElement(edge, "lane", id=f"{lane.edge}_0", index="0", speed=number_text(SPEED))
    row.set("length", number_text(length))
    row.set("width", number_text(road.lane_width))
    row.set("shape", shape_text(offset(line, -0.5 * road.lane_width)))


def shape_text(line: Floats) -> str:
    """Return points as ``x,y x,y``."""
    return " ".join(f"{number_text(float(x))},{number_text(float(y))}" for x, y in line)


def _links(into: list[Lane], out: list[Lane]) -> list[tuple[Lane, Lane]]:
    """Return the pairs of lanes into and out of a junction; turning round only at a dead end."""
    return [(a, b) for a in into for b in out if b.road != a.road or len(out) == 1]


def _junction(
    root: Element, name: str, made: RoadMap, into: list[Lane], links: list[tuple[Lane, Lane]]
) -> None:
    junction = made.junctions[name]
    kind = "allway_stop" if junction.all_way_stop else "priority"
    size = max(made.roads[lane.road].lane_width for lane in into)
    ring = np.array([(cos(k * pi / 4), sin(k * pi / 4)) for k in range(8)])
    element = SubElement(root, "junction", id=name, type=kind)
    element.set("x", number_text(junction.x))
    element.set("y", number_text(junction.y))
    element.set("incLanes", " ".join(f"{lane.edge}_0" for lane in into))
    element.set("intLanes", "")
    element.set("shape", shape_text(np.array(junction[:2]) + size * ring))
    for index, (a, _) in enumerate(links):
        foes = "".join("1" if other.edge != a.edge and len(into) > 2 else "0" for other, _ in reversed(links))
        SubElement(element, "request", index=str(index), response=foes, foes=foes, cont="0")


def _connections(root: Element, links: list[tuple[Lane, Lane]], stop: bool) -> None:
    for a, b in links:
        element = SubElement(
            root, "connection", {"from": a.edge, "to": b.edge, "fromLane": "0", "toLane": "0"}
        )
        element.set("dir", "t" if a.road == b.road else DIRECTIONS[turn(a.into, b.out)])
        element.set("state", "w" if stop else "M")
