import json
from math import cos, pi, sin, sqrt
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.roads.checks import meetings
from dubins_traffic.roads.clearance import clearance_faults
from dubins_traffic.roads.formats.rnd import FIELDS
from dubins_traffic.roads.generate import generate, most_segments, random_network, thinned_grid
from dubins_traffic.roads.network import RoadNetwork

json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=6,
)
keys = st.text().filter(lambda key: key not in FIELDS)
moves = st.tuples(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(-7.0, 7.0))
quick = settings(max_examples=60, deadline=None, derandomize=True)


@st.composite
def networks(draw: st.DrawFn) -> RoadNetwork:
    count = draw(st.integers(2, 24))
    roads = draw(st.integers(count - 1, most_segments(count)))
    network = generate(count, roads, draw(st.integers(0, 2**64 - 1)))
    length = draw(st.floats(0.1, 100.0))
    extra = draw(st.dictionaries(keys, json_values, max_size=3))
    return RoadNetwork(network.segments, length, draw(moves), network.shape, extra)


@quick
@given(networks())
def test_reading_what_was_written_gives_the_same_network(network: RoadNetwork) -> None:
    assert RoadNetwork.from_text(network.to_json()) == network
    assert RoadNetwork.from_text(network.to_text()) == network
    assert RoadNetwork.from_document(json.loads(json.dumps(network.to_document()))) == network


@quick
@given(networks(), moves, st.integers(0, 2**32 - 1))
def test_a_rigid_motion_changes_no_answer(network: RoadNetwork, move: Any, seed: int) -> None:
    still = RoadNetwork(network.segments, network.length, (0.0, 0.0, 0.0), network.shape)
    moved = RoadNetwork(network.segments, network.length, move, network.shape)
    scale = network.length * max(network.shape)
    points = scale * np.random.default_rng(seed).uniform(-0.2, 1.2, (50, 2))
    tx, ty, theta = move
    turn = np.array([[cos(theta), -sin(theta)], [sin(theta), cos(theta)]])
    there = points @ turn.T + [tx, ty]
    close = 1e-9 * (1.0 + scale)
    assert (still.lengths == moved.lengths).all()
    assert moved.to_world(still.to_lattice(points)) == pytest.approx(there, abs=close)
    assert moved.to_lattice(there) == pytest.approx(points / network.length, abs=1e-9 * (1 + max(network.shape)))
    assert moved.nearest_segment(there)[1] == pytest.approx(still.nearest_segment(points)[1], abs=close)
    assert moved.nearest_intersection(there)[1] == pytest.approx(still.nearest_intersection(points)[1], abs=close)
    for lane in (0, still.lanes - 1):
        for a, b in zip(moved.lane_coordinates(lane, there), still.lane_coordinates(lane, points), strict=True):
            assert a == pytest.approx(b, abs=close)
    for v in range(len(still.points)):
        assert moved.arms(v) == still.arms(v)
        assert (moved.routes_to(v).next_lane == still.routes_to(v).next_lane).all()


@settings(max_examples=120, deadline=None, derandomize=True)
@given(st.data())
def test_generated_networks_are_what_was_asked_for(data: st.DataObject) -> None:
    count = data.draw(st.integers(2, 70))
    roads = data.draw(st.integers(count - 1, most_segments(count)))
    angle = data.draw(st.sampled_from([0.2, pi / 3, 1.3, pi / 2]))
    w = data.draw(st.sampled_from([0.1, 0.3, 0.5]))
    radius = w * data.draw(st.sampled_from([2.9, 1 / 0.3, 5.0]))
    reach = w * data.draw(st.sampled_from([0.2, 0.59, 1.5]))
    seed = data.draw(st.integers(0, 2**64 - 1))
    wishes: dict[str, Any] = {"minimum_angle": angle, "w": w, "radius": radius, "reach": reach}
    network = generate(count, roads, seed, rigid_motion=True, **wishes)
    assert RoadNetwork(network.segments, network.length, network.transform, network.shape) == network
    assert (len(network.intersections), len(network.segments)) == (count, roads)
    assert clearance_faults(network, radius, reach, w) == []
    assert network.degrees.max() <= 4
    assert _sharpest(network) >= angle - 1e-6
    assert generate(count, roads, seed, rigid_motion=True, **wishes) == network


def _sharpest(network: RoadNetwork) -> float:
    least = pi
    for v in range(len(network.points)):
        out = [(1 - 2 * (lane & 1)) * network.tangents[lane >> 1] for lane in network.arms(v)]
        for k, a in enumerate(out):
            for b in out[:k]:
                least = min(least, float(np.arccos(np.clip(a @ b, -1.0, 1.0))))
    return least


@quick
@given(st.integers(1, 9), st.integers(2, 9), st.floats(0.0, 1.0), st.integers(0, 2**64 - 1))
def test_thinned_grids_stay_connected(rows: int, columns: int, removed: float, seed: int) -> None:
    grid = RoadNetwork.grid(rows, columns)
    take = int(removed * len(grid.segments) + 1e-9)
    if take > len(grid.segments) - rows * columns + 1:
        with pytest.raises(InputError, match="to stay connected"):
            thinned_grid(Draws(seed, 0, 1), rows, columns, removed)
        return
    network = thinned_grid(Draws(seed, 0, 1), rows, columns, removed)
    assert len(network.segments) == len(grid.segments) - take
    assert network.intersections == grid.intersections
    assert set(network.segments) <= set(grid.segments)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.lists(st.tuples(*[st.integers(0, 4)] * 4).filter(lambda s: s[:2] != s[2:]), min_size=2, max_size=8))
def test_meetings_are_those_of_fractions(segments: list[tuple[int, int, int, int]]) -> None:
    expected = {(i, j) for j in range(len(segments)) for i in range(j) if _overlap(segments[i], segments[j])}
    assert {(int(i), int(j)) for i, j in meetings(np.array(segments, dtype=np.int64))} == expected


def _overlap(p: tuple[int, ...], q: tuple[int, ...]) -> bool:
    """Whether two segments meet elsewhere than at a common end, by many exact points of both."""
    ends = {p[:2], p[2:]} & {q[:2], q[2:]}

    def side(a: Any, b: Any, c: Any) -> int:
        turn = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        return (turn > 0) - (turn < 0)

    def holds(s: tuple[int, ...], c: Any) -> bool:
        a, b = s[:2], s[2:]
        between = all(min(a[k], b[k]) <= c[k] <= max(a[k], b[k]) for k in (0, 1))
        return side(a, b, c) == 0 and between

    touching = [c for c in (p[:2], p[2:]) if holds(q, c)] + [c for c in (q[:2], q[2:]) if holds(p, c)]
    if any(c not in ends for c in touching):
        return True
    if len(ends) == 2:
        return True
    crossing = side(p[:2], p[2:], q[:2]) * side(p[:2], p[2:], q[2:]) < 0
    return crossing and side(q[:2], q[2:], p[:2]) * side(q[:2], q[2:], p[2:]) < 0


@pytest.mark.parametrize("count", [2, 3, 4, 7, 12, 50, 1000])
def test_the_most_segments(count: int) -> None:
    assert most_segments(count) == int(2 * count - 2 * sqrt(count) + 1e-9)


def test_draws_decide() -> None:
    networks = {random_network(Draws(seed, trial, 1), 12, 14).segments for seed in (0, 1) for trial in (0, 1)}
    assert len(networks) == 4
