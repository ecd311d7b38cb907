"""Tells exactly whether standing bodies and obstacles overlap, in plain Python, for starts that are given.

A shape is its corners, in order, and a rounding: a disc is one corner, rounded.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import sqrt
from typing import NamedTuple

from dubins_traffic.cars.body import Body, Disc, DiscObstacle, Obstacle
from dubins_traffic.cars.state import Pose

Point = tuple[float, float]


class Shape(NamedTuple):
    """Corners of a polygon (one: a point) and the radius by which it is grown, metres."""

    corners: tuple[Point, ...]
    rounding: float


def body_shape(body: Body, pose: Pose) -> Shape:
    """Return the shape of a car's body at `pose`."""
    x, y, c, s = pose
    if isinstance(body, Disc):
        return Shape(((x, y),), body.radius)
    h, k = 0.5 * body.length, 0.5 * body.width
    signs = ((h, k), (-h, k), (-h, -k), (h, -k))
    return Shape(tuple((x + a * c - b * s, y + a * s + b * c) for a, b in signs), 0.0)


def obstacle_shape(obstacle: Obstacle) -> Shape:
    """Return the shape of an obstacle."""
    if isinstance(obstacle, DiscObstacle):
        return Shape(((obstacle.x, obstacle.y),), obstacle.radius)
    return Shape(obstacle.vertices, 0.0)


def overlap(a: Shape, b: Shape) -> bool:
    """Tell whether two shapes have a point in common."""
    reach = a.rounding + b.rounding
    if contains(a, b.corners[0]) or contains(b, a.corners[0]):
        return True
    return any(_near(p, q, r, s, reach) for p, q in edges(a) for r, s in edges(b))


def edges(shape: Shape) -> Iterator[tuple[Point, Point]]:
    """Yield the edges of a shape; of a point, the point twice."""
    corners = shape.corners
    for k in range(len(corners)):
        yield corners[k], corners[(k + 1) % len(corners)]


def contains(shape: Shape, point: Point) -> bool:
    """Tell whether `point` lies inside the polygon of a shape, by the number of edges to its right."""
    x, y = point
    inside = False
    for (x0, y0), (x1, y1) in edges(shape):
        if (y0 > y) != (y1 > y) and x < x0 + (y - y0) / (y1 - y0) * (x1 - x0):
            inside = not inside
    return inside


def _near(p: Point, q: Point, r: Point, s: Point, reach: float) -> bool:
    """Tell whether the edges pq and rs cross or come within `reach`."""
    if _side(p, q, r) * _side(p, q, s) < 0 and _side(r, s, p) * _side(r, s, q) < 0:
        return True
    gaps = (_gap(p, r, s), _gap(q, r, s), _gap(r, p, q), _gap(s, p, q))
    return min(gaps) <= reach


def _side(a: Point, b: Point, p: Point) -> float:
    return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])


def _gap(p: Point, a: Point, b: Point) -> float:
    """Distance from `p` to the edge ab."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    square = dx * dx + dy * dy
    along = ((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / square if square > 0 else 0.0
    along = min(1.0, max(0.0, along))
    gx, gy = p[0] - a[0] - along * dx, p[1] - a[1] - along * dy
    return sqrt(gx * gx + gy * gy)
