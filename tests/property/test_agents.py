"""What holds of e-agents whatever the network, the seed and the batch."""

import math
import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import Point, Polygon
from shapely.affinity import rotate, translate

from dubins_traffic.agents import fleet
from dubins_traffic.agents.sight import Box, sees
from dubins_traffic.cars.body import Bounds, Car, Rectangle
from dubins_traffic.cars.state import Pose
from dubins_traffic.kernels.trig import sincos
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.roads.packing import pack
from dubins_traffic.routing.lane_graph import FAR, aim_for, spread
from tests.fleets import GRID, crowd, digest, in_lane, instance, medley, run

angle = st.floats(-math.pi, math.pi)
WEDGE = Polygon([(0, 0), *((9 * math.cos(a), 9 * math.sin(a)) for a in np.linspace(-2.0, 2.0, 65))])
LONG = RoadNetwork.from_document(
    {
        "version": 0,
        "length": 2.5,
        "transform": [3.0, -1.0, 0.7],
        "shape": [5, 7],
        "segments": [[0, 0, 6, 0], [6, 0, 3, 4], [0, 0, 3, 4], [3, 4, 0, 4], [6, 0, 6, 2]],
    }
)


@given(angle, st.floats(0.0, 1.2), angle, angle, st.floats(0.0, 0.6), st.floats(0.0, 0.4), st.floats(0.01, 0.2))
@settings(max_examples=300, deadline=None, derandomize=True)
def test_sight_agrees_with_shapely(heading, distance, bearing, turned, a, b, r) -> None:
    box = Polygon([(a, b), (-a, b), (-a, -b), (a, -b)]) if a > 0 < b else Point(0, 0)
    a, b = (a, b) if a > 0 < b else (0.0, 0.0)
    x, y = distance * math.cos(bearing), distance * math.sin(bearing)
    body = translate(rotate(box, turned, (0, 0), use_radians=True), x, y).buffer(r, quad_segs=64)
    nearest = body.intersection(rotate(WEDGE, heading, (0, 0), use_radians=True)).distance(Point(0, 0))
    seen = sees(0.0, 0.0, *sincos(heading), 0.5, Box(x, y, *sincos(turned), a, b, r))
    if math.isnan(nearest):
        assert not seen or body.buffer(1e-4).intersects(rotate(WEDGE, heading, (0, 0), use_radians=True))
    elif abs(nearest - 0.5) > 1e-4:
        assert seen == (nearest < 0.5) or body.buffer(-1e-4).disjoint(rotate(WEDGE, heading, (0, 0), use_radians=True))


@pytest.mark.parametrize("network", [GRID, LONG, RoadNetwork.grid(2, 5, 2.6, (0.0, 0.0, -2.0))])
def test_wander_keeps_to_the_road_and_comes_everywhere(network) -> None:
    visited, apart = set(), []

    def each(now) -> None:
        if now.tick % 5 == 0:
            visited.update((now.lanes[:, 1] >> 1).tolist())
            points = np.stack([now.state.x[:, 1], now.state.y[:, 1]], axis=1)
            apart.append(network.nearest_segment(points)[1].max())

    run([crowd([("wander", {})], network, trial=trial) for trial in range(16)], 30 * 240, each)
    assert visited == set(range(len(network.segments)))
    assert max(apart) <= 0.6


@pytest.mark.parametrize("rate", [3.0, 10.0, 100.0])
def test_wander_works_at_any_rate(rate) -> None:
    apart, driven = [], set()

    def each(now) -> None:
        driven.update(now.lanes[:, 1].tolist())
        points = np.stack([now.state.x[:, 1], now.state.y[:, 1]], axis=1)
        apart.append(GRID.nearest_segment(points)[1].max())

    run([crowd([("wander", {})], trial=trial, rate=rate) for trial in range(4)], int(rate * 60), each)
    assert max(apart) <= 0.6
    assert len(driven) > 15


def test_traffic_alone_has_no_collisions() -> None:
    kinds = [("wander", {})] * 3 + [("wander", {"patience": 1.0})] * 3 + [("parked", {"vacates_after": 5.0})] * 2
    ring = [("loop", {"cycle": [[0, 0], [1, 0], [1, 1], [0, 1]]})] * 2
    batch = [crowd(kinds + ring, trial=trial) for trial in range(30)]
    assert run(batch, 30 * 60)[1] == []


def test_rectangles_have_no_collisions_either() -> None:
    car = Car(body=Rectangle(0.5, 0.3))
    batch = [crowd([("wander", {"patience": 1.0})] * 6, trial=trial, car=car) for trial in range(20)]
    assert run(batch, 30 * 60)[1] == []


@pytest.mark.parametrize("kind", ["wander", "follow", "loop", "parked"])
@pytest.mark.parametrize("place", ["lane", "crossing", "middle"])
def test_nobody_runs_into_an_ego_that_stands(kind, place) -> None:
    given = {
        "wander": {},
        "loop": {"cycle": [[0, 0], [1, 0], [1, 1], [0, 1]]},
        "follow": {"gap": 0.0},
        "parked": {"vacates_after": 1.0},
    }[kind]
    ego = {"lane": in_lane(GRID, 0), "crossing": Pose(3.0, 0.0, 1.0, 0.0), "middle": Pose(1.5, 0.0, 0.0, 1.0)}
    batch = [
        instance([(kind, given)] * 2, [ego[place], in_lane(GRID, first), in_lane(GRID, second)], trial=first)
        for first, second in ((3, 14), (10, 5), (11, 29), (20, 22), (33, 16))
    ]
    assert run(batch, 30 * 60)[1] == []


def test_patient_traffic_does_not_jam() -> None:
    moved = np.zeros((20, 9))
    batch = [crowd([("wander", {"patience": 2.0})] * 8, trial=trial) for trial in range(20)]

    def each(now) -> None:
        if now.tick >= 30 * 60:
            moved[:] += now.commands[:, :, 0] != 0.0

    run(batch, 30 * 90, each)
    assert moved[:, 1:].min() > 0
    assert moved[:, 1:].mean() > 0.4 * 30 * 30


@pytest.mark.parametrize(
    "bounds",
    [Bounds(turning_radius=0.3), Bounds(turning_radius=0.3, speed_min=0.2), Bounds(speed_min=0.3)],
)
def test_cars_that_cannot_turn_in_place_keep_to_the_road(bounds) -> None:
    apart, driven = [], set()

    def each(now) -> None:
        driven.update(now.lanes[:, 1].tolist())
        points = np.stack([now.state.x[:, 1], now.state.y[:, 1]], axis=1)
        apart.append(GRID.nearest_segment(points)[1].max())

    car = Car(bounds=bounds)
    run([crowd([("wander", {})], trial=trial, car=car) for trial in range(4)], 30 * 60, each)
    assert max(apart) <= 0.6
    assert len(driven) > 20


def test_a_batch_is_a_loop_of_singles() -> None:
    batch = [medley(trial) for trial in range(4)]
    ego = [(0.4, 0.0)] * 60 + [(0.3, 0.6)] * 60
    together, _ = run(batch, 600, ego=ego)
    for b, single in enumerate(batch):
        alone, _ = run([single], 600, ego=ego)
        for one, all_ in zip(alone[:6], together[:6], strict=True):
            assert np.array_equal(one[0], all_[b])


def test_seeds_decide() -> None:
    def end(seed, trial):
        given = crowd([("wander", {})])
        moved = instance([("wander", {})], given.starts, seed=seed, trial=trial)
        state, _ = run([moved], 30 * 60)
        return state.x[0, 1], state.y[0, 1]

    ends = {end(seed, trial) for seed in (0, 1, 2**64 - 1) for trial in (0, 1, 7)}
    assert len(ends) == 9
    assert end(1, 7) in ends


def test_interpreted_equals_compiled() -> None:
    own = subprocess.run(
        [sys.executable, "-m", "tests.fleets", "250"],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert own.stdout == digest(250)


def test_a_rigid_motion_of_the_network_commutes() -> None:
    kinds = [*[("wander", {})] * 3, *[("wander", {"patience": 1.0})] * 2, ("follow", {})]
    motion = (2.0, -1.0, 0.7)
    ends = []
    for network in (GRID, RoadNetwork.grid(3, 4, 3.0, motion)):
        placed = crowd(kinds, network).starts
        state, _ = run([instance(kinds, [in_lane(network, 9, 0.3), *placed[1:]], network)], 900, ego=[(0.4, 0.0)] * 100)
        ends.append((state.x[0], state.y[0]))
    (x, y), (moved_x, moved_y) = ends
    c, s = math.cos(motion[2]), math.sin(motion[2])
    assert np.abs(c * x - s * y + motion[0] - moved_x).max() < 1e-9
    assert np.abs(s * x + c * y + motion[1] - moved_y).max() < 1e-9


def test_little_room_for_pairs_changes_nothing(monkeypatch) -> None:
    network = RoadNetwork.grid(4, 4, 2.0)
    batch = [crowd([("wander", {"patience": 0.5})] * 30, network, trial=trial) for trial in range(2)]
    ample, _ = run(batch, 200)
    monkeypatch.setattr(fleet, "PAIRS", 1)
    little, _ = run(batch, 200)
    assert np.array_equal(ample.x, little.x)


@given(st.integers(0, 33), st.integers(0, 33))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_hops_are_shortest(lane, goal) -> None:
    table = pack([GRID], [0.6])
    hops, queue = np.full(34, FAR), np.zeros(34, dtype=np.int64)
    spread(table, 0, hops, queue, aim_for(goal, hops, queue, 0))
    front, count = {lane}, 0
    while goal not in front:
        front |= {after for own in front for after in GRID.successors(own)}
        count += 1
    assert hops[lane] == count
