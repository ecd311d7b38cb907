"""Lanelet2 (`.osm`): lanelets between linestrings, and the regulatory element `all_way_stop`, which is rule 3."""

from __future__ import annotations

from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.roads.formats.foreign import WrittenFormat
from dubins_traffic.roads.formats.hints import with_hints
from dubins_traffic.roads.formats.lanelet2_text import write_lanelet2
from dubins_traffic.roads.formats.osm_text import Osm, has_lanelets, read_osm, tags
from dubins_traffic.roads.formats.xml_text import root_name
from dubins_traffic.roads.maps.lanelets import Lanelet, lanelet_map
from dubins_traffic.roads.maps.model import RoadMap

ROADS = frozenset({"road", "highway", "play_street", "exit", ""})
"""Subtypes of lanelets that cars use."""


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
        """Return the text of a map."""
        return write_lanelet2(made)


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
    found = [each.get("ref", "") for each in relation.findall("member") if each.get("role") == role]
    if len(found) != 1 or found[0] not in osm.ways:
        raise osm.reader.fault(f"no {role} bound", relation, found, f"one way as {role}")
    return found[0]


def _span(one: Floats, other: Floats) -> float:
    return float(np.hypot(*(one[0] - other[0])) + np.hypot(*(one[-1] - other[-1])))


def _stopping(osm: Osm) -> set[str]:
    """Return the lanelets at whose end everybody stops."""
    found: set[str] = set()
    for relation in osm.relations.values():
        if tags(relation).get("subtype") == "all_way_stop":
            members = [
                each for each in relation.findall("member") if each.get("role") in ("yield", "lanelet")
            ]
            found |= {each.get("ref", "") for each in members}
    return found
