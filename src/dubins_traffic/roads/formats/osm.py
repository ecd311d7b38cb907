"""OpenStreetMap (`.osm`): ways that are roads, cut where they meet. It is read only."""

from __future__ import annotations

import re
from collections import Counter
from itertools import pairwise
from xml.etree.ElementTree import Element

import numpy as np

from dubins_traffic.display import count
from dubins_traffic.errors import InputError
from dubins_traffic.roads.formats.foreign import ForeignFormat
from dubins_traffic.roads.formats.osm_text import Osm, has_lanelets, read_osm, tags
from dubins_traffic.roads.formats.xml_text import root_name
from dubins_traffic.roads.maps.model import Junction, Road, RoadMap

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
            found = f"{count(len(osm.nodes), 'node')} and {count(len(osm.ways), 'way')}"
            expected = "at least one way with the tag highway of a road for cars"
            raise InputError("no roads", file=file, value=found, expected=expected)
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
        own = f"{name}#{part}" if len(places) > 2 else name
        made.append(Road(own, nodes[begin], nodes[end], line, forward, backward, width, None, closed))
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
    found = _NUMBER.match(text)
    return float(found[0]) if found else 0.0


def _metres(text: str) -> float:
    """Return the metres that a value says, in metres unless it says feet: ``5.5``, ``5.5 m``, ``16 ft``, ``16'6"``."""
    feet = _FEET.match(text)
    return _FOOT * (float(feet[1]) + _number(feet[2]) / 12.0) if feet else _number(text)


def _stops(osm: Osm, cuts: set[str]) -> set[str]:
    """Return the nodes at which all stop: tagged so themselves."""
    return {node for node in cuts if osm.stops.get(node) == "all"}
