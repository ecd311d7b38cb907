"""A road network of ours as a road map, and such a map as a network again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.angles import sincos
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.maps.model import Corner, Frame, Junction, Road, RoadMap
from dubins_traffic.maps.polylines import cleaned, rounded, to_segments

CROSSING_DEGREE = 3
"""From how many roads on a junction is a crossing, where rule 3 holds."""
LANE_WIDTH = 0.6
"""Lanes of a network are 2w wide."""
SAGITTA = 1e-3
"""Polylines leave the arcs for which they stand by at most this many metres."""
DIGITS = 12
"""Lattice coordinates are rounded to so many digits when a network is found again."""


def road_map(document: Mapping[str, Any]) -> RoadMap:
    """Return the map of an RND document, in metres: junctions ``v0``, ... and roads ``s0``, ... in their order."""
    frame = Frame(float(document["length"]), *(float(entry) for entry in document.get("transform", (0, 0, 0))))
    rows = [[float(number) for number in row] for row in document["segments"]]
    names: dict[tuple[float, float], str] = {}
    degrees: dict[str, int] = {}
    roads: list[Road] = []
    for s, row in enumerate(rows):
        ends = [names.setdefault((row[k], row[k + 1]), f"v{len(names)}") for k in (0, 2)]
        for end in ends:
            degrees[end] = degrees.get(end, 0) + 1
        places = _to_world(np.array([row[0:2], row[2:4], *(row[k : k + 2] for k in range(4, len(row), 3))]), frame)
        radii = [frame.length * radius for radius in row[6::3]]
        corners = tuple((float(x), float(y), radius) for (x, y), radius in zip(places[2:], radii, strict=True))
        # Where two arcs fill the side between them, the first ends at the point at which the second begins.
        line = cleaned(rounded(places[0], corners, places[1], SAGITTA))
        roads.append(Road(f"s{s}", ends[0], ends[1], line, 1, 1, LANE_WIDTH, corners))
    placed = _to_world(np.array(list(names)), frame)
    junctions = {
        name: Junction(float(x), float(y), degrees[name] >= CROSSING_DEGREE)
        for name, (x, y) in zip(names.values(), placed, strict=True)
    }
    return RoadMap(junctions, tuple(roads), frame)


def network_document(road_map: RoadMap) -> dict[str, Any] | None:
    """Return the RND document of a map that was a network of ours, None if it is none any more."""
    frame = road_map.frame
    if frame is None or not all(_is_ours(road, road_map.junctions) for road in road_map.roads):
        return None
    rows = [_row(road, road_map.junctions, frame) for road in road_map.roads]
    whole = all(len(row) == 4 and all(isinstance(number, int) for number in row) for row in rows)
    return {
        "version": 0 if whole else 2,
        "length": frame.length,
        "transform": list(frame[1:]),
        "segments": rows,
    }


def _is_ours(road: Road, junctions: Mapping[str, Junction]) -> bool:
    """Whether a road is as a network has it: plain, and a straight line or known corners that its line keeps to."""
    if not road.is_plain:
        return False
    start, end = np.array(junctions[road.first][:2]), np.array(junctions[road.last][:2])
    curve = rounded(start, road.corners or (), end, SAGITTA)
    return bool(to_segments(road.line, curve).max() < 3.0 * SAGITTA)


def read_frame(text: str, file: str | None) -> Frame:
    """Return the frame in a text; InputError if it is none."""
    numbers = _numbers(text, file)
    if len(numbers) != 4 or not numbers[0] > 0.0:
        raise InputError("not a frame", file=file, value=text, expected="length, x, y and angle")
    return Frame(*numbers)


def read_corners(text: str, file: str | None) -> tuple[Corner, ...]:
    """Return the corners in a text ``x y radius x y radius ...``; InputError if they are none."""
    numbers = _numbers(text, file)
    if len(numbers) % 3 or any(not radius > 0.0 for radius in numbers[2::3]):
        raise InputError("not corners", file=file, value=text, expected="x, y and a radius above 0 for each corner")
    return tuple((numbers[k], numbers[k + 1], numbers[k + 2]) for k in range(0, len(numbers), 3))


def corners_text(corners: Sequence[Corner]) -> str:
    """Return corners as a text."""
    return " ".join(repr(number) for corner in corners for number in corner)


def _numbers(text: str, file: str | None) -> list[float]:
    try:
        numbers = [float(part) for part in text.split()]
    except ValueError:
        numbers = [float("nan")]
    if not np.isfinite(numbers).all():
        raise InputError("not numbers", file=file, value=text, expected="finite numbers with blanks between them")
    return numbers


def _row(road: Road, junctions: Mapping[str, Junction], frame: Frame) -> list[float]:
    corners = road.corners or ()
    places = [junctions[road.first][:2], junctions[road.last][:2], *((x, y) for x, y, _ in corners)]
    lattice = [[_plain(number) for number in place] for place in _to_lattice(np.array(places), frame).tolist()]
    bends = [
        number
        for place, (_, _, radius) in zip(lattice[2:], corners, strict=True)
        for number in (*place, _plain(radius / frame.length))
    ]
    return [*lattice[0], *lattice[1], *bends]


def _plain(number: float) -> float:
    """Return a number without the rounding of the way here."""
    short = round(number, DIGITS)
    return int(short) if short.is_integer() else short


def _to_world(points: Floats, frame: Frame) -> Floats:
    c, s = sincos(frame.theta)
    x, y = frame.length * points[:, 0], frame.length * points[:, 1]
    return np.stack([c * x - s * y + frame.x, s * x + c * y + frame.y], axis=-1)


def _to_lattice(points: Floats, frame: Frame) -> Floats:
    c, s = sincos(frame.theta)
    x, y = points[:, 0] - frame.x, points[:, 1] - frame.y
    return np.stack([c * x + s * y, c * y - s * x], axis=-1) / frame.length
