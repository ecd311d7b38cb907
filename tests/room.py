"""Whether a network has the room that the rules need, worked out by shapely from the lines of its roads."""

from __future__ import annotations

from itertools import combinations
from math import acos, asin, degrees, hypot

import numpy as np
from shapely.geometry import LineString, Point

from dubins_traffic.roads.network import RoadNetwork

R, RHO, W, SLACK = 1.0, 0.177, 0.3, 0.5
PLAY = 2e-3
"""What the chords of arcs may take away, metres."""


def lacking(network: RoadNetwork) -> list[str]:
    """Return what a network lacks of docs/rules.md#room, for cars of the usual size."""
    lines = [LineString(network.lane_curve(2 * s, 0.0, 1e-3)) for s in range(len(network.segments))]
    straight = R + RHO + SLACK
    found: list[str] = []
    for s, line in enumerate(lines):
        if line.length < 2.0 * straight - SLACK - PLAY:
            found.append(f"{s} is short")
        for ends in (line.coords[:2], line.coords[:-3:-1]):
            (x0, y0), (x1, y1) = ends
            if hypot(x1 - x0, y1 - y0) < min(straight, line.length) - PLAY:
                found.append(f"{s} bends near an end")
    corners = network.corners or ()
    found += [f"corner of {s}" for s, own in enumerate(corners) for each in own if each[2] * network.length < 3.0 * W]
    for v, u in combinations(range(len(network.points)), 2):
        if hypot(*(network.points[v] - network.points[u])) < 2.0 * (R + RHO):
            found.append(f"{v} and {u} are close")
    for s, line in enumerate(lines):
        for v, point in enumerate(network.points):
            if v not in network.ends[s] and line.distance(Point(*point)) < R + 2.0 * W + RHO - PLAY:
                found.append(f"{v} beside {s}")
    least = degrees(2.0 * asin(2.0 * W / (R + RHO)))
    for v in range(len(network.points)):
        for one, other in combinations(network.arms(v), 2):
            (ax, ay), (bx, by) = (_direction(lines, lane) for lane in (one, other))
            if degrees(acos(np.clip(ax * bx + ay * by, -1.0, 1.0))) < least:
                found.append(f"arms {one} and {other} at {v}")
    return found


def _direction(lines: list[LineString], lane: int) -> tuple[float, float]:
    coordinates = list(lines[lane >> 1].coords)
    (x0, y0), (x1, y1) = coordinates[:2] if not lane & 1 else coordinates[:-3:-1]
    size = hypot(x1 - x0, y1 - y0)
    return (x1 - x0) / size, (y1 - y0) / size
