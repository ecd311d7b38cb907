"""What OSM files hold, Lanelet2's among them: nodes, ways and relations with tags, and where nodes lie in metres."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.roads.formats.xml_text import Reader, parse, place
from dubins_traffic.roads.maps.mercator import middle_meridian, to_metres


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
        found = [self.reader.text(each, "ref") for each in way.findall("nd")]
        for name in found:
            if name not in self.nodes:
                raise self.reader.fault("no such node", way, name, "the id of a node")
        if len(found) < 2:
            raise self.reader.fault("no line", way, len(found), "two nodes or more")
        return found

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
    stops = {name: own.get("stop", "") for name, own in signs.items() if own.get("highway") == "stop"}
    return Osm(reader, _places(reader, nodes), ways, relations, stops)


def has_lanelets(text: str) -> bool:
    """Tell whether something in an OSM text is a lanelet."""
    return 'v="lanelet"' in text or "v='lanelet'" in text


def tags(element: Element) -> dict[str, str]:
    """Return the tags of an element."""
    return {each.get("k", ""): each.get("v", "") for each in element.findall("tag")}


def _places(reader: Reader, nodes: Mapping[str, Element]) -> dict[str, tuple[float, float]]:
    own = {name: tags(each) for name, each in nodes.items()}
    if own and all("local_x" in each and "local_y" in each for each in own.values()):
        return {
            name: (
                reader.parsed(each["local_x"], f"node[{name}]"),
                reader.parsed(each["local_y"], f"node[{name}]"),
            )
            for name, each in own.items()
        }
    found = {
        name: (_degrees(reader, each, "lat", 85.0), _degrees(reader, each, "lon", 180.0))
        for name, each in nodes.items()
    }
    if not found:
        return {}
    first = next(iter(found.values()))
    meridian = middle_meridian(first[1])
    if any(abs(longitude - meridian) > 20.0 for _, longitude in found.values()):
        raise InputError("too wide", file=reader.file, expected="a map of one town")
    x0, y0 = to_metres(*first, meridian)
    placed = {name: to_metres(*each, meridian) for name, each in found.items()}
    return {name: (x - x0, y - y0) for name, (x, y) in placed.items()}


def _degrees(reader: Reader, node: Element, name: str, most: float) -> float:
    value = reader.number(node, name)
    if abs(value) > most:
        field = f"{place(node)}.{name}"
        raise InputError(
            "out of range", file=reader.file, field=field, value=value, expected=f"degrees up to {most:g}"
        )
    return value
