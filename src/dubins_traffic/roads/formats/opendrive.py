"""OpenDRIVE (`.xodr`): lines, arcs, clothoids and cubics along the middle of roads, lanes on both sides."""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree.ElementTree import Element

import numpy as np

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.roads.formats.foreign import WrittenFormat
from dubins_traffic.roads.formats.hints import with_hints
from dubins_traffic.roads.formats.opendrive_text import write_opendrive
from dubins_traffic.roads.formats.xml_text import Reader, parse, place, root_name
from dubins_traffic.roads.maps.geometry import Placed, clothoid, cubic, cubic_over, straight
from dubins_traffic.roads.maps.junctions import End, joined_where_equal, junctions_of
from dubins_traffic.roads.maps.model import Road, RoadMap
from dubins_traffic.roads.maps.pairing import OneWay, paired
from dubins_traffic.roads.maps.polylines import along, cleaned
from dubins_traffic.roads.maps.union import Union

LANE_WIDTH = 3.5
"""Width of a lane that gives none."""
FOR_CARS = frozenset({"driving", "entry", "exit", "onRamp", "offRamp", "connectingRamp", "bidirectional"})
LONGEST = 1e6
"""Metres of one piece."""
WIDEST_GAP = 1.0
"""Metres between the end of a piece and the beginning of the next: they meet, but for what rounding leaves."""


class OpenDrive(WrittenFormat):
    """Road networks of OpenDRIVE, version 1.4 to 1.8."""

    name = "opendrive"
    suffixes = (".xodr",)
    description = "OpenDRIVE"

    def sniff(self, text: str) -> bool:
        """Tell whether the root element is `OpenDRIVE`."""
        return root_name(text) == "OpenDRIVE"

    def read_map(self, text: str, file: str | None = None) -> RoadMap:
        """Return the map in a text: roads outside junctions, and where these lie by the roads that end there."""
        root = parse(text, "OpenDRIVE", file)
        reader = Reader(file)
        elements = reader.unique(root.iter("road"))
        outer = {name: each for name, each in elements.items() if each.get("junction", "-1") == "-1"}
        lines = {name: _line(reader, each) for name, each in outer.items()}
        junctions, names = junctions_of(_joined(reader, elements, outer, lines), lines)
        roads: list[Road] = []
        single: list[OneWay] = []
        for name, each in outer.items():
            forward, backward, width = _lanes(reader, each)
            first, last = names[End(name, True)], names[End(name, False)]
            if forward and backward:
                roads.append(Road(name, first, last, lines[name], forward, backward, width))
            elif forward:
                single.append(OneWay(name, first, last, lines[name], forward, width))
            elif backward:
                single.append(OneWay(name, last, first, lines[name][::-1], backward, width))
        return with_hints(RoadMap(junctions, (*roads, *paired(single))), text, file).checked(file)

    def write_map(self, made: RoadMap) -> str:
        """Return the text of a map."""
        return write_opendrive(made)


def _joined(
    reader: Reader, elements: Mapping[str, Element], outer: Mapping[str, Element], lines: Mapping[str, Floats]
) -> Union[End]:
    """Return which ends of roads outside junctions belong together: by their links, or since they are at one point."""
    union = Union[End]()
    at: dict[str, list[End]] = {}
    for name, each in outer.items():
        for tag, begins in (("predecessor", True), ("successor", False)):
            link = each.find(f"link/{tag}")
            if link is None:
                continue
            other, kind = reader.text(link, "elementId"), link.get("elementType", "road")
            if kind == "junction":
                at.setdefault(other, []).append(End(name, begins))
            elif other not in elements:
                raise reader.fault("linked to no road", each, other, "the id of a road")
            elif other in outer:
                union.join((End(name, begins), End(other, link.get("contactPoint", "start") == "start")))
            else:
                at.setdefault(elements[other].get("junction", ""), []).append(End(name, begins))
    for ends in at.values():
        union.join(ends)
    joined_where_equal(union, lines)
    return union


def _line(reader: Reader, road: Element) -> Floats:
    """Return points along the reference line of a road."""
    geometry = road.findall("planView/geometry")
    if not geometry:
        raise reader.fault("has no line", road, None, "<planView> with a <geometry>")
    line = _shifted(reader, road, cleaned(np.concatenate(_pieces(reader, geometry))))
    if float(np.abs(line - line[0]).max()) < 1e-9:
        raise reader.fault("has no length", road, road.get("length"), "a line longer than nothing")
    return line


def _pieces(reader: Reader, geometry: list[Element]) -> list[Floats]:
    """Return points along the pieces of a reference line, in their order; each begins where the one before ends."""
    geometry = sorted(geometry, key=lambda each: reader.number(each, "s"))
    found = [_piece(reader, each) for each in geometry]
    for each, before, after in zip(geometry[1:], found[:-1], found[1:], strict=True):
        gap = float(np.hypot(*(after[0] - before[-1])))
        if gap > WIDEST_GAP:
            expected = f"one that begins within {WIDEST_GAP:g} m of there"
            raise reader.fault("not where the piece before ends", each, f"{gap:.3g} m away", expected)
    return found


def _shifted(reader: Reader, road: Element, line: Floats) -> Floats:
    """Return a reference line moved to the left by the lane offset, so that it runs between the two directions."""
    rows = road.findall("lanes/laneOffset")
    if not rows:
        return line
    begins = np.array([reader.number(each, "s") for each in rows])
    cubics = np.array([_coefficients(reader, each, "abcd", "") for each in rows])
    s = along(line)
    place = np.searchsorted(begins, s + 1e-9, side="right") - 1
    past = s - begins[place]
    a, b, c, d = cubics[place].T
    left = np.where(place >= 0, a + past * (b + past * (c + past * d)), 0.0)
    step = np.diff(line, axis=0)
    unit = step / np.maximum(np.sqrt((step * step).sum(axis=1)), 1e-300)[:, None]
    both = np.concatenate([unit[:1], unit[:-1] + unit[1:], unit[-1:]])
    both /= np.maximum(np.sqrt((both * both).sum(axis=1)), 1e-300)[:, None]
    return line + left[:, None] * np.stack([-both[:, 1], both[:, 0]], axis=-1)


def _piece(reader: Reader, geometry: Element) -> Floats:
    where = Placed(*(reader.number(geometry, name) for name in ("x", "y", "hdg", "length")))
    if not 0.0 <= where.length <= LONGEST:
        expected = f"metres in [0, {LONGEST:g}]"
        raise reader.fault("not a length", geometry, where.length, expected)
    shapes = [each for each in geometry if each.tag in _SHAPES]
    if len(shapes) != 1:
        expected = f"one of {', '.join(_SHAPES)}"
        raise reader.fault("not one shape", geometry, [each.tag for each in geometry], expected)
    shape = shapes[0]
    if shape.tag == "line":
        return straight(where)
    if shape.tag == "arc":
        curvature = _curvature(reader, shape, "curvature")
        return clothoid(where, curvature, curvature)
    if shape.tag == "spiral":
        return clothoid(where, _curvature(reader, shape, "curvStart"), _curvature(reader, shape, "curvEnd"))
    if shape.tag == "poly3":
        return cubic_over(where, _coefficients(reader, shape, "abcd", ""))
    last = where.length if shape.get("pRange", "normalized") == "arcLength" else 1.0
    return cubic(
        where, _coefficients(reader, shape, "abcd", "U"), _coefficients(reader, shape, "abcd", "V"), last
    )


_SHAPES = ("line", "arc", "spiral", "poly3", "paramPoly3")


def _curvature(reader: Reader, shape: Element, name: str) -> float:
    value = reader.number(shape, name)
    if abs(value) > 1e3:
        raise reader.fault("too sharp", shape, value, "a curvature in [-1000, 1000]")
    return value


def _coefficients(reader: Reader, shape: Element, names: str, suffix: str) -> Floats:
    found = np.array([reader.number(shape, name + suffix) for name in names])
    if float(np.abs(found).max()) > 1e7:
        raise reader.fault("too large", shape, found.tolist(), "coefficients in [-1e7, 1e7]")
    return found


def _lanes(reader: Reader, road: Element) -> tuple[int, int, float]:
    """Return the lanes for cars along a road and against it, and their width; the longest section counts."""
    sections = road.findall("lanes/laneSection")
    if not sections:
        raise InputError("has no lanes", file=reader.file, field=place(road), expected="a <laneSection>")
    begins = [reader.number(each, "s", 0.0) for each in sections]
    lengths = np.diff([*begins, max(reader.number(road, "length", 0.0), begins[-1])])
    section = sections[int(np.argmax(lengths))]
    along_it, against_it = ("left", "right") if road.get("rule") == "LHT" else ("right", "left")
    sides = [
        [lane for lane in section.findall(f"{side}/lane") if lane.get("type") in FOR_CARS]
        for side in (along_it, against_it)
    ]
    widths = [
        reader.number(width, "a")
        for lane in (*sides[0], *sides[1])
        if (width := lane.find("width")) is not None
    ]
    usual = max(widths, default=LANE_WIDTH)
    return len(sides[0]), len(sides[1]), usual if usual > 0.0 else LANE_WIDTH
