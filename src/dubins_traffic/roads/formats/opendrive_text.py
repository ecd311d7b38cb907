"""OpenDRIVE (`.xodr`), written from road maps: roads from centre to centre, made of lines and arcs."""

from __future__ import annotations

from math import atan2
from xml.etree.ElementTree import Element, SubElement

from dubins_traffic.roads.chain import Piece, chain
from dubins_traffic.roads.formats.hints import hints_text
from dubins_traffic.roads.formats.xml_text import document, number_text
from dubins_traffic.roads.maps.model import Road, RoadMap


def write_opendrive(made: RoadMap) -> str:
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
    element = SubElement(
        root, "road", id=str(number), name=road.name, junction="-1", length=number_text(length)
    )
    link = SubElement(element, "link")
    for tag, at, here in (("predecessor", road.first, "start"), ("successor", road.last, "end")):
        others = [end for end in meet[at] if end != (number, here)]
        if len(others) > 1:
            SubElement(link, tag, elementType="junction", elementId=numbers[at])
        elif others:
            other, contact = others[0]
            SubElement(link, tag, elementType="road", elementId=str(other), contactPoint=contact)
    _plan(element, pieces)
    _lanes(element, road.lane_width)


def _plan(road: Element, pieces: tuple[Piece, ...]) -> None:
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


def _lanes(road: Element, width: float) -> None:
    section = SubElement(SubElement(road, "lanes"), "laneSection", s="0")
    for side, lane, kind in (("left", "1", "driving"), ("center", "0", "none"), ("right", "-1", "driving")):
        element = SubElement(SubElement(section, side), "lane", id=lane, type=kind, level="false")
        if lane != "0":
            SubElement(element, "width", sOffset="0", a=number_text(width), b="0", c="0", d="0")
        SubElement(element, "roadMark", sOffset="0", type="broken" if lane == "0" else "solid", width="0.1")
