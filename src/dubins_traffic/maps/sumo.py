"""Road networks of SUMO (`.net.xml`): lanes are written from centre to centre, none in junctions."""

from __future__ import annotations

from math import atan2, cos, pi, sin
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.maps.foreign import WrittenFormat, hints_text, turn, with_hints
from dubins_traffic.maps.junctions import OneWay, paired
from dubins_traffic.maps.model import Junction, Road, RoadMap
from dubins_traffic.maps.polylines import offset, true_length
from dubins_traffic.maps.xml_text import Reader, document, number_text, parse, place
from dubins_traffic.roads.formats.xml_root import root_name

LANE_WIDTH = 3.2
"""Width of a lane that gives none."""
STOP = "allway_stop"
CARS = frozenset({"passenger"})
ROAD_TRAFFIC = frozenset({"bus", "coach", "delivery", "taxi", "truck", "trailer"})
SPEED = 1.0
DIRECTIONS = {"straight": "s", "left": "l", "right": "r"}


class SumoNet(WrittenFormat):
    """Road networks of SUMO."""

    name = "sumo"
    suffixes = (".net.xml",)
    description = "road network of SUMO"

    def sniff(self, text: str) -> bool:
        """Tell whether the root element is `net`."""
        return root_name(text) == "net"

    def read_map(self, text: str, file: str | None = None) -> RoadMap:
        """Return the map in a SUMO network; InputError if the text is broken."""
        root = parse(text, "net", file)
        reader = Reader(file)
        named = reader.unique(each for each in root.iter("junction") if each.get("type") != "internal")
        junctions = {
            name: Junction(reader.number(each, "x"), reader.number(each, "y"), each.get("type") == STOP)
            for name, each in named.items()
        }
        edges = reader.unique(each for each in root.iter("edge") if each.get("function", "normal") == "normal")
        directions = [_direction(reader, each, junctions) for each in edges.values()]
        made = RoadMap(junctions, paired([one for one in directions if one.lanes]))
        return with_hints(made, text, file).checked(file)

    def write_map(self, made: RoadMap) -> str:
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
        for name, link in links.items():
            _connections(root, link, made.junctions[name].all_way_stop)
        return document(root, hints_text(made, [road.name for road in made.roads]))


def _direction(reader: Reader, edge: Element, junctions: dict[str, Junction]) -> OneWay:
    first, last = reader.text(edge, "from"), reader.text(edge, "to")
    for name, end in (("from", first), ("to", last)):
        if end not in junctions:
            field = f"{place(edge)}.{name}"
            raise InputError("no such junction", file=reader.file, field=field, value=end, expected="a junction's id")
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
    line = read_shape(reader, edge, shape) if shape else np.array([junctions[end][:2] for end in (first, last)])
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
            raise InputError("not a point", file=reader.file, field=field, value=point, expected="x,y or x,y,z")
        rows.append((reader.parsed(parts[0], field), reader.parsed(parts[1], field)))
    if len(rows) < 2:
        raise InputError("not a line", file=reader.file, field=field, value=text, expected="two points or more")
    return np.array(rows)


class Lane(NamedTuple):
    """A lane: the name of its edge, its road, the junctions where it begins and ends, and its bearings there."""

    edge: str
    road: int
    first: str
    last: str
    out: float
    into: float


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


def _junction(root: Element, name: str, made: RoadMap, into: list[Lane], links: list[tuple[Lane, Lane]]) -> None:
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
        element = SubElement(root, "connection", {"from": a.edge, "to": b.edge, "fromLane": "0", "toLane": "0"})
        element.set("dir", "t" if a.road == b.road else DIRECTIONS[turn(a.into, b.out)])
        element.set("state", "w" if stop else "M")
