"""Places on roads against shapely: 10,000 points, on grids and on random networks, in NumPy and compiled."""

from math import sqrt

import numpy as np
import pytest
import shapely

from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.roads import lookup
from dubins_traffic.roads.generate import generate, thinned_grid
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.roads.packing import pack

pytestmark = pytest.mark.path

HALF_WIDTH = 0.6
CASES = 1_000
NETWORKS = [
    RoadNetwork.grid(3, 4),
    RoadNetwork.grid(2, 2, 5.0, (1.0, -2.0, 0.5)),
    RoadNetwork.grid(1, 30, 3.0, (0.0, 0.0, 2.0)),
    RoadNetwork.grid(12, 12, 3.0, (100.0, 50.0, -1.2)),
    RoadNetwork.grid(1, 2, 0.01),
    thinned_grid(Draws(1, 0, 1), 8, 8, 0.3, rigid_motion=True),
    generate(12, 14, 1, rigid_motion=True),
    generate(60, 90, 2, rigid_motion=True),
    generate(300, 380, 3, rigid_motion=True),
    RoadNetwork(((0, 0, 1, 0), (1, 0, 400, 7), (400, 7, 399, 9)), 3.0, (0.0, 0.0, 1.0), (10, 401)),
]
TABLE = pack(NETWORKS, [HALF_WIDTH] * len(NETWORKS))


@jit
def look_up(t, net, p, segment, d2, vertex, v2, on):
    for k in range(len(p)):
        segment[k], d2[k] = lookup.nearest_segment(t, net, p[k, 0], p[k, 1])
        vertex[k], v2[k] = lookup.nearest_vertex(t, net, p[k, 0], p[k, 1])
        on[k] = lookup.on_road(t, net, p[k, 0], p[k, 1])


def _points(network: RoadNetwork, seed: int) -> np.ndarray:
    """Points about the roads, over the whole box and far outside, and such that lie exactly on an end."""
    random = np.random.default_rng(seed)
    low, high = network.points.min(axis=0) - 4.0, network.points.max(axis=0) + 4.0
    box = low + (high - low) * random.random((CASES // 2, 2))
    s = random.integers(len(network.segments), size=CASES // 2 - 40)
    t = network.tangents[s]
    along = network.lengths[s] * random.uniform(-0.1, 1.1, len(s))
    across = random.uniform(-0.9, 0.9, len(s))
    near = network.points[network.ends[s, 0]] + along[:, None] * t + across[:, None] * t[:, ::-1] * [-1.0, 1.0]
    ends = network.points[random.integers(len(network.points), size=20)]
    far = random.uniform(-1e4, 1e4, (20, 2))
    return np.concatenate([box, near, ends, far])


@pytest.mark.parametrize("net", range(len(NETWORKS)))
def test_places_agree_with_shapely(net: int) -> None:
    network = NETWORKS[net]
    points = _points(network, net)
    lines = shapely.linestrings(network.points[network.ends])
    gaps = shapely.distance(shapely.points(points)[:, None], lines[None, :])
    least = gaps.min(axis=1)
    segment, distance = network.nearest_segment(points)
    assert distance == pytest.approx(least, abs=1e-9)
    assert gaps[np.arange(len(points)), segment] == pytest.approx(least, abs=1e-9)
    first = np.argmax(gaps <= least[:, None] + 1e-12, axis=1)
    clear = np.sort(gaps, axis=1)[:, 1] > least + 1e-9 if len(lines) > 1 else np.ones(len(points), dtype=bool)
    assert (segment[clear] == first[clear]).all()
    spread = shapely.distance(shapely.points(points)[:, None], shapely.points(network.points)[None, :])
    vertex, away = network.nearest_intersection(points)
    assert away == pytest.approx(spread.min(axis=1), abs=1e-9)
    assert spread[np.arange(len(points)), vertex] == pytest.approx(spread.min(axis=1), abs=1e-9)
    on = network.on_road(points, HALF_WIDTH)
    decided = np.abs(least - HALF_WIDTH) > 1e-9
    assert (on[decided] == (least <= HALF_WIDTH)[decided]).all()


@pytest.mark.parametrize("net", range(len(NETWORKS)))
def test_compiled_places_are_the_same_bit_for_bit(net: int) -> None:
    network = NETWORKS[net]
    points = _points(network, net)
    count = len(points)
    segment, vertex = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
    d2, v2, on = np.zeros(count), np.zeros(count), np.zeros(count, dtype=np.bool_)
    look_up(TABLE, net, points, segment, d2, vertex, v2, on)
    for own, square, plain in (
        (segment, d2, network.nearest_segment(points)),
        (vertex, v2, network.nearest_intersection(points)),
    ):
        assert (own == plain[0]).all()
        assert (np.sqrt(square) == plain[1]).all()
    assert (on == network.on_road(points, HALF_WIDTH)).all()
    plain_segments = [_plain(TABLE, net, x, y, len(network.segments)) for x, y in points[:200]]
    assert plain_segments == list(zip(segment[:200].tolist(), d2[:200].tolist(), strict=True))


def _plain(t, net, x, y, count):
    """The nearest segment, interpreted and without cells."""
    squares = [lookup.distance2.py_func(t, net, s, x, y) for s in range(count)]
    return squares.index(min(squares)), min(squares)


def test_lane_coordinates_agree_with_shapely() -> None:
    for net, network in enumerate(NETWORKS):
        points = _points(network, net)[:100]
        for lane in range(0, network.lanes, 1 + network.lanes // 20):
            (x0, y0), (x1, y1) = network.lane_line(lane, 0.0)
            line = shapely.LineString([(x0, y0), (x1, y1)])
            along, left = network.lane_coordinates(lane, points)
            inside = (along > 0) & (along < line.length)
            assert along[inside] == pytest.approx(
                shapely.line_locate_point(line, shapely.points(points[inside])), abs=1e-8
            )
            assert np.abs(left[inside]) == pytest.approx(
                shapely.distance(line, shapely.points(points[inside])), abs=1e-8
            )
            side = (x1 - x0) * (points[:, 1] - y0) - (y1 - y0) * (points[:, 0] - x0)
            assert ((side > 0) == (left > 0))[np.abs(left) > 1e-9].all()
            for k in range(5):
                x, y = points[k].tolist()
                assert lookup.lane_coordinates(TABLE, net, lane, x, y) == (along[k], left[k])
            tips = lookup.lane_start(TABLE, net, lane), lookup.lane_end(TABLE, net, lane)
            assert tips == network.lane_ends(lane)
            tx, ty = lookup.lane_direction(TABLE, net, lane)
            assert (tx * (x1 - x0) + ty * (y1 - y0)) / sqrt((x1 - x0) ** 2 + (y1 - y0) ** 2) == pytest.approx(1.0)


def test_tables_hold_what_kernels_need() -> None:
    for array in TABLE:
        assert array.flags.c_contiguous
        assert array.flags.writeable
        kinds = [kind for kind, _ in (array.dtype.fields or {"": (array.dtype, 0)}).values()]
        assert all(kind in (np.float64, np.int64) for kind in kinds)
    v = NETWORKS[0].vertex((1, 1))
    assert TABLE.arms[v].tolist() == list(NETWORKS[0].arms(v))
    corner = TABLE.arms[TABLE.vert_off[1]]
    assert corner[2:].tolist() == [-1, -1]


def test_generated_networks_are_planar_and_clear_by_shapely() -> None:
    for network in NETWORKS[6:9]:
        lines = shapely.linestrings(network.points[network.ends])
        a, b = np.triu_indices(len(lines), 1)
        share = (network.ends[a][:, :, None] == network.ends[b][:, None, :]).any(axis=(1, 2))
        gap = shapely.distance(lines[a], lines[b])
        assert (gap[~share] >= 1.0 + 0.177 + 0.6 - 1e-9).all()
        assert (shapely.length(lines) >= 2.854 - 1e-9).all()
        spread = shapely.distance(*(shapely.points(network.points)[k] for k in np.triu_indices(len(network.points), 1)))
        assert (spread >= 2.354 - 1e-9).all()
