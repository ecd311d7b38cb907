"""Body contact against shapely: 10,000 random pairs of rounded boxes and rays."""

import math

import numpy as np
import pytest
from shapely import LineString, Point, Polygon

from dubins_traffic.cars.sensing import ray_box
from dubins_traffic.kernels.boxes import NEVER, Box, corner, separation

pytestmark = pytest.mark.path


def random_box(rng):
    kind = rng.integers(3)
    half = rng.uniform(0.05, 1.0, 2) if kind == 0 else (0.0, 0.0) if kind == 1 else (rng.uniform(0.1, 1), 0.0)
    rounding = rng.uniform(0.05, 0.5) if kind == 1 else 0.0
    theta = rng.uniform(-math.pi, math.pi)
    return (*rng.uniform(-1.5, 1.5, 2), math.cos(theta), math.sin(theta)), (*half, rounding)


def as_shape(place, box):
    a, b, _ = box
    if a == b == 0:
        return Point(place[:2])
    corners = [corner(k, Box(*place, *box)) for k in (0, 1, 3, 2)]
    return LineString([corners[0], corners[3]]) if b == 0 else Polygon(corners)


def test_gaps_of_bodies() -> None:
    rng = np.random.default_rng(5)
    touching = 0
    for _ in range(10_000):
        (p, box), (q, other) = random_box(rng), random_box(rng)
        gap, nx, ny, _, _ = separation(Box(*p, *box), Box(*q, *other))
        true = as_shape(p, box).distance(as_shape(q, other)) - box[2] - other[2]
        if true > 1e-6:
            assert abs(gap - true) < 1e-6 * max(1.0, true)
        else:
            assert gap <= 2e-6
            touching += 1
        assert abs(math.hypot(nx, ny) - 1) < 1e-9
    assert touching > 1000


def test_rays() -> None:
    rng = np.random.default_rng(6)
    hits = 0
    for _ in range(5_000):
        place, box = random_box(rng)
        origin = rng.uniform(-3, 3, 2)
        theta = rng.uniform(-math.pi, math.pi)
        direction = np.array([math.cos(theta), math.sin(theta)])
        shape = as_shape(place, box)
        if box[2]:
            shape = shape.buffer(box[2], quad_segs=256)
        ray = LineString([origin, origin + 20 * direction])
        crossing = shape.intersection(ray)
        ours = ray_box(*origin, *direction, Box(*place, *box))
        if crossing.is_empty:
            grazes = shape.distance(ray) < 1e-4
            assert ours >= NEVER or grazes
        else:
            true = crossing.distance(Point(origin))
            if ours >= NEVER:
                assert crossing.length < 2e-2
            else:
                assert abs(ours - true) < 2e-2 if crossing.length < 2e-2 else abs(ours - true) < 1e-3
            hits += 1
    assert hits > 300
