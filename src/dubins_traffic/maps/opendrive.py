"""OpenDRIVE (`.xodr`): lines, arcs, clothoids and cubics along the middle of roads, lanes on both sides.

Roads are written from centre to centre, made of lines and arcs.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import atan2, ceil, cos, sin, sqrt
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.maps.foreign import WrittenFormat, hints_text, with_hints
from dubins_traffic.maps.junctions import End, OneWay, Union, joined_where_equal, junctions_of, paired
from dubins_traffic.maps.model import Road, RoadMap
from dubins_traffic.maps.polylines import along, cleaned
from dubins_traffic.maps.xml_text import Reader, document, number_text, parse, place
from dubins_traffic.roads.chains import ChainPiece, chain
from dubins_traffic.roads.formats.xml_root import root_name

LANE_WIDTH = 3.5
"""Width of a lane that gives none."""
FOR_CARS = frozenset({"driving", "entry", "exit", "onRamp", "offRamp", "connectingRamp", "bidirectional"})
LONGEST = 1e6
"""Metres of one piece."""
WIDEST_GAP = 1.0
"""Metres between the end of a piece and the beginning of the next: they meet, but for what rounding leaves."""
SAGITTA = 2e-3
"""Chords leave the curve by about this many metres."""
MOST = 4000
"""Most chords of one piece."""


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
        """Return the text of a map: roads ``0``, ``1``, ..., and junctions where more than two of them meet."""
        root = Element("OpenDRIVE")
        SubElement(root, "header", revMajor="1", revMinor="6", name="dubins-traffic", version="1")
        numbers = {name: str(k) for k, name in enumerate(made.junctions)}
        meet: dict[str, list[tuple[int, str]]] = {name: [] for name in made.junctions}
        for k, road in enumerate(made.roads):
            meet[road.first].append((k, "start"))
            meet[road.last].append((k, "end"))
        for k, road in enumerate(made.roads):
            _road(root, k, road, made, numbers, meet)
        for name, ends in meet.items():
            if len(ends) > 2:
                SubElement(root, "junction", id=numbers[name], name=name)
        return document(root, hints_text(made, [str(k) for k in range(len(made.roads))]))


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
    pieces = [_piece(reader, each) for each in geometry]
    for each, before, after in zip(geometry[1:], pieces[:-1], pieces[1:], strict=True):
        gap = float(np.hypot(*(after[0] - before[-1])))
        if gap > WIDEST_GAP:
            expected = f"one that begins within {WIDEST_GAP:g} m of there"
            raise reader.fault("not where the piece before ends", each, f"{gap:.3g} m away", expected)
    return pieces


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
    return cubic(where, _coefficients(reader, shape, "abcd", "U"), _coefficients(reader, shape, "abcd", "V"), last)


_SHAPES = ("line", "arc", "spiral", "poly3", "paramPoly3")


def _curvature(reader: Reader, shape: Element, name: str) -> float:
    value = reader.number(shape, name)
    if abs(value) > 1e3:
        raise reader.fault("too sharp", shape, value, "a curvature in [-1000, 1000]")
    return value


def _coefficients(reader: Reader, shape: Element, names: str, suffix: str) -> Floats:
    coefficients = np.array([reader.number(shape, name + suffix) for name in names])
    if float(np.abs(coefficients).max()) > 1e7:
        raise reader.fault("too large", shape, coefficients.tolist(), "coefficients in [-1e7, 1e7]")
    return coefficients


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
    widths = [reader.number(width, "a") for lane in (*sides[0], *sides[1]) if (width := lane.find("width")) is not None]
    usual = max(widths, default=LANE_WIDTH)
    return len(sides[0]), len(sides[1]), usual if usual > 0.0 else LANE_WIDTH


def _road(
    root: Element,
    number: int,
    road: Road,
    made: RoadMap,
    numbers: dict[str, str],
    meet: dict[str, list[tuple[int, str]]],
) -> None:
    first, last = made.junctions[road.first], made.junctions[road.last]
    pieces = chain((first.x, first.y), road.corners or (), (last.x, last.y))
    length = sum(piece.length for piece in pieces)
    element = SubElement(root, "road", id=str(number), name=road.name, junction="-1", length=number_text(length))
    link = SubElement(element, "link")
    for tag, at, here in (("predecessor", road.first, "start"), ("successor", road.last, "end")):
        others = [end for end in meet[at] if end != (number, here)]
        if len(others) > 1:
            SubElement(link, tag, elementType="junction", elementId=numbers[at])
        elif others:
            other, contact = others[0]
            SubElement(link, tag, elementType="road", elementId=str(other), contactPoint=contact)
    _plan(element, pieces)
    _write_lanes(element, road.lane_width)


def _plan(road: Element, pieces: tuple[ChainPiece, ...]) -> None:
    plan = SubElement(road, "planView")
    s = 0.0
    for piece in pieces:
        values = {
            "s": s,
            "x": piece.x,
            "y": piece.y,
            "hdg": atan2(piece.ty, piece.tx),
            "length": piece.length,
        }
        geometry = SubElement(plan, "geometry", {name: number_text(value) for name, value in values.items()})
        if piece.side == 0.0:
            SubElement(geometry, "line")
        else:
            SubElement(geometry, "arc", curvature=number_text(piece.side / piece.radius))
        s += piece.length


def _write_lanes(road: Element, width: float) -> None:
    section = SubElement(SubElement(road, "lanes"), "laneSection", s="0")
    for side, lane, kind in (("left", "1", "driving"), ("center", "0", "none"), ("right", "-1", "driving")):
        element = SubElement(SubElement(section, side), "lane", id=lane, type=kind, level="false")
        if lane != "0":
            SubElement(element, "width", sOffset="0", a=number_text(width), b="0", c="0", d="0")
        SubElement(element, "roadMark", sOffset="0", type="broken" if lane == "0" else "solid", width="0.1")


class Placed(NamedTuple):
    """Where a piece begins: x, y, heading (radians), and its length, metres."""

    x: float
    y: float
    heading: float
    length: float


def straight(place: Placed) -> Floats:
    """Return both ends of a line."""
    return _moved(place, np.array([[0.0, 0.0], [place.length, 0.0]]))


def clothoid(place: Placed, begin: float, end: float) -> Floats:
    """Return points on a piece whose curvature changes evenly from `begin` to `end`; equal ones are an arc's."""
    count = _count(place.length, max(abs(begin), abs(end)))
    s = np.linspace(0.0, place.length, 2 * count + 1)
    turn = begin * s + 0.5 * (end - begin) * s * s / max(place.length, 1e-300)
    # Simpson's rule on each of `count` stretches.
    step = place.length / count
    steps = [step / 6.0 * (each[:-1:2] + 4.0 * each[1::2] + each[2::2]) for each in (np.cos(turn), np.sin(turn))]
    points = np.concatenate([np.zeros((1, 2)), np.cumsum(np.stack(steps, axis=-1), axis=0)])
    return _moved(place, points)


def cubic(place: Placed, u: Floats, v: Floats, last: float) -> Floats:
    """Return points on (u(p), v(p)), p from 0 to `last`: cubics by their four coefficients, constant first."""
    p = np.linspace(0.0, last, 65)
    for _ in range(3):
        points = np.stack([_value(u, p), _value(v, p)], axis=-1)
        step = np.diff(points, axis=0)
        bent = np.abs(step[:-1, 0] * step[1:, 1] - step[:-1, 1] * step[1:, 0])
        off = 0.25 * bent / np.maximum(np.sqrt((step * step).sum(axis=1))[:-1], 1e-300)
        if float(off.max(initial=0.0)) <= SAGITTA or len(p) >= MOST:
            break
        p = np.linspace(0.0, last, 4 * (len(p) - 1) + 1)
    return _moved(place, np.stack([_value(u, p), _value(v, p)], axis=-1))


def cubic_over(place: Placed, v: Floats) -> Floats:
    """Return points on v(u), u from 0 until the piece is as long as it should be."""
    u = np.linspace(0.0, place.length, 513)
    points = np.stack([u, _value(v, u)], axis=-1)
    step = np.diff(points, axis=0)
    along = np.concatenate([[0.0], np.cumsum(np.sqrt((step * step).sum(axis=1)))])
    return cubic(place, np.array([0.0, 1.0, 0.0, 0.0]), v, float(np.interp(place.length, along, u)))


def _value(c: Floats, p: Floats) -> Floats:
    return c[0] + p * (c[1] + p * (c[2] + p * c[3]))


def _count(length: float, curvature: float) -> int:
    return min(MOST, max(16, ceil(length / sqrt(8.0 * SAGITTA / max(curvature, 1e-12)))))


def _moved(place: Placed, points: Floats) -> Floats:
    c, s = cos(place.heading), sin(place.heading)
    x, y = points[:, 0], points[:, 1]
    return np.stack([place.x + c * x - s * y, place.y + s * x + c * y], axis=-1)
