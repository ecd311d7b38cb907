"""Questions to a road network: our compiled functions and our arrays, against shapely's tree of the same segments.

The points lie about a random network of 100 intersections, within its box. A query is one point.
"""

from __future__ import annotations

from collections.abc import Callable
from time import process_time

import numpy as np
import shapely

from benchmarks.table import Row
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.compile import jit
from dubins_traffic.roads.generate import generate
from dubins_traffic.roads.lookup import nearest_segment, nearest_vertex, on_road
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.roads.packing import pack
from dubins_traffic.roads.table import RoadTable

POINTS, ROUNDS = 200_000, 5
HALF_WIDTH = 0.6


@jit
def nearest_segments(roads: RoadTable, x: Floats, y: Floats, found: Ints) -> None:
    """Find the segment nearest to each point."""
    for k in range(len(x)):
        found[k] = nearest_segment(roads, 0, x[k], y[k])[0]


@jit
def nearest_intersections(roads: RoadTable, x: Floats, y: Floats, found: Ints) -> None:
    """Find the intersection nearest to each point."""
    for k in range(len(x)):
        found[k] = nearest_vertex(roads, 0, x[k], y[k])[0]


@jit
def all_on_road(roads: RoadTable, x: Floats, y: Floats, found: Ints) -> None:
    """Tell of each point whether it is on the road."""
    for k in range(len(x)):
        found[k] = 1 if on_road(roads, 0, x[k], y[k]) else 0


def measure() -> list[Row]:
    """Return the rows of this benchmark; answers are compared before times are."""
    network = generate(100, 140, 1)
    roads = pack([network], [HALF_WIDTH])
    low, high = network.points.min(axis=0), network.points.max(axis=0)
    points = np.random.default_rng(1).uniform(low, high, (POINTS, 2))
    x, y = np.ascontiguousarray(points.T)
    segments, found = np.zeros(POINTS, dtype=np.int64), np.zeros(POINTS, dtype=np.int64)
    tree = shapely.STRtree(shapely.linestrings(network.points[network.ends]))
    cloud = shapely.points(points)
    compiled = _best(lambda: nearest_segments(roads, x, y, segments))
    arrays = _best(lambda: network.nearest_segment(points))
    theirs = _best(lambda: tree.nearest(cloud))
    _check(network, points, segments, tree.nearest(cloud))
    rows = [
        Row(f"nearest segment, shapely {shapely.__version__}: its tree", _figure(theirs), "", True),
        Row("nearest segment, arrays", f"{_figure(arrays)}, {theirs / arrays:.1f} times as fast", "", True),
        Row(
            "nearest segment, compiled",
            f"{_figure(compiled)}, {theirs / compiled:.0f} times as fast",
            "",
            True,
        ),
    ]
    for name, work in (
        ("nearest intersection", lambda: nearest_intersections(roads, x, y, found)),
        ("on the road", lambda: all_on_road(roads, x, y, found)),
    ):
        rows.append(Row(f"{name}, compiled", _figure(_best(work)), "", True))
    return rows


def _check(network: RoadNetwork, points: Floats, ours: Ints, theirs: Ints) -> None:
    """Compare the distances, since several segments may be equally near."""
    lines = shapely.linestrings(network.points[network.ends])
    cloud = shapely.points(points)
    one, other = (shapely.distance(lines[which], cloud) for which in (ours, theirs))
    if not np.allclose(one, other, rtol=0.0, atol=1e-9):
        raise AssertionError("shapely finds nearer segments")


def _best(work: Callable[[], object]) -> float:
    """Return the seconds of the best round; the first one warms up."""
    took: list[float] = []
    for _ in range(ROUNDS + 1):
        began = process_time()
        work()
        took.append(process_time() - began)
    return min(took[1:])


def _figure(seconds: float) -> str:
    return f"{POINTS / seconds:.2e} points/s"
