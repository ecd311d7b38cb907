"""Roads that bend against shapely: 10,000 points about random chains, in NumPy and compiled."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from dubins_traffic.kernels.compile import jit
from dubins_traffic.roads import lookup
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.roads.packing import pack

pytestmark = pytest.mark.path

CHAINS = 50
CASES = 200
WIDE = 0.6
FINE = 2.5e-4
"""How far the lines in place of arcs may be from them, metres."""


def _chain(number: int) -> RoadNetwork:
    """Return a network of one random road, wherever the polygon turns to the left or the right, moved rigidly."""
    random = np.random.default_rng(number)
    x, y, heading = 0.0, 0.0, 0.0
    corners: list[list[float]] = []
    for _ in range(int(random.integers(1, 6))):
        step = random.uniform(4.0, 6.0)
        x, y = x + step * math.cos(heading), y + step * math.sin(heading)
        turn = random.uniform(-1.4, 1.4)
        corners.append([x, y, random.uniform(1.0, 1.9 / math.tan(0.7))])
        heading = min(max(heading + turn, -1.5), 1.5)
    last = [x + 5.0 * math.cos(heading), y + 5.0 * math.sin(heading)]
    row = [0.0, 0.0, *last, *(entry for corner in corners for entry in corner)]
    motion = [*random.uniform(-9.0, 9.0, 2).tolist(), random.uniform(-4.0, 4.0)]
    return RoadNetwork.from_document({"version": 2, "length": 1.3, "transform": motion, "segments": [row]})


@jit
def look_up(t, net, p, s, left, d2, on):
    for k in range(len(p)):
        s[k], left[k] = lookup.lane_coordinates(t, net, 1, p[k, 0], p[k, 1])
        _, d2[k] = lookup.nearest_segment(t, net, p[k, 0], p[k, 1])
        on[k] = lookup.on_road(t, net, p[k, 0], p[k, 1])


@pytest.mark.parametrize("block", range(5))
def test_places_on_curves_agree_with_shapely(block: int) -> None:
    networks = [_chain(number) for number in range(block * CHAINS // 5, (block + 1) * CHAINS // 5)]
    table = pack(networks, [WIDE] * len(networks))
    for net, network in enumerate(networks):
        random = np.random.default_rng((1, block, net))
        line = shapely.LineString(network.lane_curve(0, 0.0, FINE))
        assert line.length == pytest.approx(float(network.lengths[0]), rel=1e-4)
        low, high = np.array(line.bounds[:2]) - 2.0, np.array(line.bounds[2:]) + 2.0
        spots = random.uniform(low, high, (CASES // 4, 2))
        along = random.uniform(0.0, network.lengths[0], CASES - CASES // 4)
        place, way = network.lane_places(0, along)
        aside = random.uniform(-0.9, 0.9, len(along))
        beside = place + aside[:, None] * np.stack([-way[:, 1], way[:, 0]], axis=-1)
        points = np.concatenate([beside, spots])
        count = len(points)
        s, left, d2, on = np.empty(count), np.empty(count), np.empty(count), np.empty(count, dtype=np.bool_)
        look_up(table, net, points, s, left, d2, on)
        distance = shapely.distance(line, shapely.points(points))
        assert np.abs(np.sqrt(d2) - distance).max() < 2.0 * FINE
        sure = np.abs(distance - WIDE) > 3.0 * FINE
        assert (on[sure] == (distance[sure] < WIDE)).all()
        assert np.abs(s[: len(along)] - (network.lengths[0] - along)).max() < 1e-9
        assert np.abs(left[: len(along)] + aside).max() < 1e-9
        plain, off = network.lane_coordinates(1, points)
        assert (plain == s).all()
        assert (off == left).all()
        assert (network.nearest_segment(points)[1] == np.sqrt(d2)).all()
