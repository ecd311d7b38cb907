"""OpenStreetMap (`.osm`): ways that are roads, cut where they meet. It is read only.

What OSM files hold, Lanelet2's among them, is read by `read_osm`: nodes, ways and relations with tags, and where nodes
lie in metres, by the transverse Mercator projection of UTM, WGS 84.

Source of the projection: Krueger's series to the fourth order in the third flattening; see Karney, Transverse Mercator
with an accuracy of a few nanometers, 2011.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from itertools import pairwise
from math import asinh, atan, atan2, atanh, cos, cosh, degrees, hypot, radians, sin, sinh, sqrt, tan
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from dubins_traffic.display import count
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.maps.foreign import ForeignFormat
from dubins_traffic.maps.model import Junction, Road, RoadMap
from dubins_traffic.maps.xml_text import Reader, parse, place
from dubins_traffic.roads.formats.xml_root import root_name

LANE_WIDTH = 3.2
TWO_LANES = frozenset({"motorway", "trunk"})
"""Kinds of roads with two lanes in a direction, unless a way tells."""
ROADS = TWO_LANES | {
    "primary", "secondary", "tertiary", "unclassified", "residential", "living_street", "service", "road",
    "motorway_link", "trunk_link", "primary_link", "secondary_link", "tertiary_link", "busway",
}  # fmt: skip
"""Kinds of ways that are roads."""
_NUMBER = re.compile(r"\d{1,3}(\.\d{1,6})?")
_FEET = re.compile(r"(\d{1,3}(?:\.\d{1,6})?)\s*(?:ft|feet|foot|')\s*(\d*)")
_FOOT = 0.3048
"""Metres."""
EQUATOR = 6378137.0
FLATTENING = 1.0 / 298.257223563
SHRUNK = 0.9996
"""Scale of the middle meridian of a zone."""
_N = FLATTENING / (2.0 - FLATTENING)
_E = sqrt(FLATTENING * (2.0 - FLATTENING))
_A = EQUATOR / (1.0 + _N) * (1.0 + _N**2 / 4.0 + _N**4 / 64.0)
_THERE = (
    _N / 2 - 2 * _N**2 / 3 + 5 * _N**3 / 16 + 41 * _N**4 / 180,
    13 * _N**2 / 48 - 3 * _N**3 / 5 + 557 * _N**4 / 1440,
    61 * _N**3 / 240 - 103 * _N**4 / 140,
    49561 * _N**4 / 161280,
)
_BACK = (
    _N / 2 - 2 * _N**2 / 3 + 37 * _N**3 / 96 - _N**4 / 360,
    _N**2 / 48 + _N**3 / 15 - 437 * _N**4 / 1440,
    17 * _N**3 / 480 - 37 * _N**4 / 840,
    4397 * _N**4 / 161280,
)


class OpenStreetMap(ForeignFormat):
    """Extracts of OpenStreetMap in XML."""

    name = "osm"
    suffixes = (".osm",)
    description = "OpenStreetMap, read only"

    def sniff(self, text: str) -> bool:
        """Tell whether the root element is `osm` and nothing is a lanelet."""
        return root_name(text) == "osm" and not has_lanelets(text)

    def read_map(self, text: str, file: str | None = None) -> RoadMap:
        """Return the map in a text."""
        osm = read_osm(text, file)
        ways = {name: each for name, each in osm.ways.items() if tags(each).get("highway") in ROADS}
        refs = {name: osm.refs(each) for name, each in ways.items()}
        uses = Counter(node for nodes in refs.values() for node in nodes)
        ends = {node for nodes in refs.values() for node in (nodes[0], nodes[-1])}
        cuts = ends | {node for node, count in uses.items() if count > 1}
        if not ways:
            says = f"{count(len(osm.nodes), 'node')} and {count(len(osm.ways), 'way')}"
            expected = "at least one way with the tag highway of a road for cars"
            raise InputError("no roads", file=file, value=says, expected=expected)
        roads = [road for name, each in ways.items() for road in _roads(osm, name, each, refs[name], cuts)]
        stops = _stops(osm, cuts)
        junctions = {node: Junction(*osm.nodes[node], node in stops) for node in sorted(cuts)}
        return RoadMap(junctions, tuple(roads)).checked(file)


def _roads(osm: Osm, name: str, way: Element, nodes: list[str], cuts: set[str]) -> list[Road]:
    """Return the roads of a way, from cut to cut."""
    forward, backward, width, closed = _lanes(tags(way))
    places = [k for k, node in enumerate(nodes) if node in cuts]
    made: list[Road] = []
    for part, (begin, end) in enumerate(pairwise(places)):
        line = np.array([osm.nodes[node] for node in nodes[begin : end + 1]])
        label = f"{name}#{part}" if len(places) > 2 else name
        made.append(Road(label, nodes[begin], nodes[end], line, forward, backward, width, None, closed))
    return made


def _lanes(what: dict[str, str]) -> tuple[int, int, float, bool]:
    """Return lanes along a way and against it, their width, and whether the way is not for cars."""
    kind = what.get("highway", "")
    oneway = what.get("oneway", "yes" if what.get("junction") == "roundabout" or kind == "motorway" else "no")
    usual = 2 if kind in TWO_LANES else 1
    single = oneway in ("yes", "true", "1", "-1", "reverse")
    every = round(_number(what.get("lanes", ""))) or (usual if single else 2 * usual)
    if single:
        forward, backward = every, 0
    else:
        forward = round(_number(what.get("lanes:forward", ""))) or max(1, every // 2)
        backward = round(_number(what.get("lanes:backward", ""))) or max(1, every - forward)
    if oneway in ("-1", "reverse"):
        forward, backward = backward, forward
    width = _metres(what.get("width", "")) / max(1, forward + backward)
    access = what.get("motor_vehicle", what.get("vehicle", what.get("access", "yes")))
    return forward, backward, width or LANE_WIDTH, kind == "busway" or access == "no"


def _number(text: str) -> float:
    """Return the number with which a value begins, 0 if there is none."""
    match = _NUMBER.match(text)
    return float(match[0]) if match else 0.0


def _metres(text: str) -> float:
    """Return the metres that a value says, in metres unless it says feet: ``5.5``, ``5.5 m``, ``16 ft``, ``16'6"``."""
    feet = _FEET.match(text)
    return _FOOT * (float(feet[1]) + _number(feet[2]) / 12.0) if feet else _number(text)


def _stops(osm: Osm, cuts: set[str]) -> set[str]:
    """Return the nodes at which all stop: tagged so themselves."""
    return {node for node in cuts if osm.stops.get(node) == "all"}


class Osm(NamedTuple):
    """An OSM file; places of nodes are metres, from the first node on unless the file has metres itself.

    `stops` says of nodes with a stop sign for whom it is: ``all``, ``minor``, or nothing.
    """

    reader: Reader
    nodes: Mapping[str, tuple[float, float]]
    ways: Mapping[str, Element]
    relations: Mapping[str, Element]
    stops: Mapping[str, str]

    def refs(self, way: Element) -> list[str]:
        """Return the nodes of a way; InputError if one is missing, or there are fewer than two."""
        refs = [self.reader.text(each, "ref") for each in way.findall("nd")]
        for name in refs:
            if name not in self.nodes:
                raise self.reader.fault("no such node", way, name, "the id of a node")
        if len(refs) < 2:
            raise self.reader.fault("no line", way, len(refs), "two nodes or more")
        return refs

    def line(self, way: Element) -> Floats:
        """Return the places of the nodes of a way."""
        return np.array([self.nodes[name] for name in self.refs(way)])


def read_osm(text: str, file: str | None = None) -> Osm:
    """Return what an OSM text holds; InputError if it is broken."""
    root = parse(text, "osm", file)
    reader = Reader(file)
    nodes = reader.unique(iter(root.findall("node")))
    ways = reader.unique(iter(root.findall("way")))
    relations = reader.unique(iter(root.findall("relation")))
    signs = {name: tags(each) for name, each in nodes.items() if len(each)}
    stops = {name: sign.get("stop", "") for name, sign in signs.items() if sign.get("highway") == "stop"}
    return Osm(reader, _places(reader, nodes), ways, relations, stops)


def has_lanelets(text: str) -> bool:
    """Tell whether something in an OSM text is a lanelet."""
    return 'v="lanelet"' in text or "v='lanelet'" in text


def tags(element: Element) -> dict[str, str]:
    """Return the tags of an element."""
    return {each.get("k", ""): each.get("v", "") for each in element.findall("tag")}


def _places(reader: Reader, nodes: Mapping[str, Element]) -> dict[str, tuple[float, float]]:
    given = {name: tags(each) for name, each in nodes.items()}
    if given and all("local_x" in each and "local_y" in each for each in given.values()):
        return {
            name: (
                reader.parsed(each["local_x"], f"node[{name}]"),
                reader.parsed(each["local_y"], f"node[{name}]"),
            )
            for name, each in given.items()
        }
    places = {
        name: (_degrees(reader, each, "lat", 85.0), _degrees(reader, each, "lon", 180.0))
        for name, each in nodes.items()
    }
    if not places:
        return {}
    first = next(iter(places.values()))
    meridian = middle_meridian(first[1])
    if any(abs(longitude - meridian) > 20.0 for _, longitude in places.values()):
        raise InputError("too wide", file=reader.file, expected="a map of one town")
    x0, y0 = to_metres(*first, meridian)
    placed = {name: to_metres(*each, meridian) for name, each in places.items()}
    return {name: (x - x0, y - y0) for name, (x, y) in placed.items()}


def _degrees(reader: Reader, node: Element, name: str, most: float) -> float:
    value = reader.number(node, name)
    if abs(value) > most:
        field = f"{place(node)}.{name}"
        raise InputError("out of range", file=reader.file, field=field, value=value, expected=f"degrees up to {most:g}")
    return value


def to_metres(latitude: float, longitude: float, meridian: float) -> tuple[float, float]:
    """Return (east, north) of a place in degrees: metres from the equator and a middle meridian (degrees)."""
    away = radians(longitude - meridian)
    tau = _conformal(tan(radians(latitude)))
    xi, eta = atan2(tau, cos(away)), asinh(sin(away) / hypot(tau, cos(away)))
    north, east = xi, eta
    for k, a in enumerate(_THERE, start=1):
        north += a * sin(2 * k * xi) * cosh(2 * k * eta)
        east += a * cos(2 * k * xi) * sinh(2 * k * eta)
    return SHRUNK * _A * east, SHRUNK * _A * north


def to_degrees(east: float, north: float, meridian: float) -> tuple[float, float]:
    """Return latitude and longitude of what `to_metres` maps to (east, north)."""
    xi, eta = north / (SHRUNK * _A), east / (SHRUNK * _A)
    inner_xi, inner_eta = xi, eta
    for k, b in enumerate(_BACK, start=1):
        inner_xi -= b * sin(2 * k * xi) * cosh(2 * k * eta)
        inner_eta -= b * cos(2 * k * xi) * sinh(2 * k * eta)
    wanted = sin(inner_xi) / hypot(sinh(inner_eta), cos(inner_xi))
    tau = wanted
    for _ in range(6):
        tau -= (_conformal(tau) - wanted) * _slope(tau)
    return degrees(atan(tau)), meridian + degrees(atan2(sinh(inner_eta), cos(inner_xi)))


def middle_meridian(longitude: float) -> float:
    """Return the middle meridian of the zone of UTM in which a longitude lies, degrees."""
    return 6.0 * ((longitude + 180.0) // 6.0) - 177.0


def _conformal(tau: float) -> float:
    """Return the tangent of the conformal latitude from that of the latitude."""
    sigma = sinh(_E * atanh(_E * tau / hypot(1.0, tau)))
    return tau * hypot(1.0, sigma) - sigma * hypot(1.0, tau)


def _slope(tau: float) -> float:
    """Return about how fast the latitude's tangent grows with the conformal latitude's."""
    return (1.0 + (1.0 - _E * _E) * tau * tau) / ((1.0 - _E * _E) * hypot(1.0, tau) * hypot(1.0, _conformal(tau)))
