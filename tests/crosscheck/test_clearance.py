"""Clearances against shapely."""

from dataclasses import replace

import numpy as np
import pytest
from shapely import LineString, Point, Polygon, affinity, box

from dubins_traffic.cars.body import Disc, DiscObstacle, PolygonObstacle, Rectangle
from dubins_traffic.kernels.boxes import Box, box_gap
from dubins_traffic.scoring.judging import Judging
from tests.recordings import feed, make_instance, random_frames

pytestmark = pytest.mark.path


def placed(x: float, y: float, c: float, s: float, half_length: float, half_width: float):
    if half_width == 0.0:
        shape = LineString([(-half_length, 0), (half_length, 0)]) if half_length else Point(0, 0)
    else:
        shape = box(-half_length, -half_width, half_length, half_width)
    return affinity.affine_transform(shape, [c, -s, s, c, x, y])


def test_distances_of_boxes_are_those_of_shapely() -> None:
    draw = np.random.Generator(np.random.Philox(3))
    count = 2000
    angle = draw.uniform(-np.pi, np.pi, (2, count))
    angle[:, ::5] = np.round(angle[:, ::5] / (np.pi / 2)) * (np.pi / 2)
    pose = [np.column_stack([draw.uniform(-1, 1, (count, 2)), np.cos(a), np.sin(a)]) for a in angle]
    half = draw.uniform(0.05, 0.8, (2, count, 2))
    half[1, ::3, 1] = 0.0
    half[0, ::7] = 0.0
    boxes = [[Box(*p, *h, 0.0) for p, h in zip(one, size, strict=True)] for one, size in zip(pose, half, strict=True)]
    found = np.array([box_gap(one, other) for one, other in zip(*boxes, strict=True)])
    expected = [placed(*pose[0][k], *half[0][k]).distance(placed(*pose[1][k], *half[1][k])) for k in range(count)]
    assert 100 < np.count_nonzero(found == 0.0) < count - 100
    assert np.allclose(found, expected, rtol=0.0, atol=1e-12)


def test_the_smallest_clearance_is_that_of_shapely() -> None:
    corners = ((3.0, 3.0), (4.0, 3.0), (3.4, 3.3), (3.0, 4.0))
    obstacles = (DiscObstacle(-2.0, 1.0, 0.3), PolygonObstacle(corners))
    outline = Polygon(corners).exterior
    for seed in range(30):
        body = Rectangle(0.5, 0.3) if seed % 2 else Disc(0.2)
        instance = make_instance(body=body, obstacles=obstacles, names=["agent0", "agent1"])
        frames = replace(random_frames(instance, seed, 40, spread=10.0), contacts=())
        judging = Judging()
        feed(instance, frames, judging)
        half, grown = ((0.25, 0.15), 0.0) if seed % 2 else ((0.0, 0.0), 0.2)
        gaps = []
        for f in range(40):
            ego, *others = (
                placed(frames.x[f, n], frames.y[f, n], frames.c[f, n], frames.s[f, n], *half) for n in range(3)
            )
            gaps += [ego.distance(other) - 2 * grown for other in others]
            gaps += [ego.distance(Point(-2.0, 1.0)) - grown - 0.3, ego.distance(outline) - grown]
        assert abs(judging.findings().gap - max(0.0, min(gaps))) < 1e-12
