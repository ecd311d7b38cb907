import math
import pickle
import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest

from dubins_traffic.errors import InputError
from dubins_traffic.roads.network import RoadNetwork

GRID = RoadNetwork.grid(3, 4)
TEE = RoadNetwork(((0, 0, 1, 0), (1, 0, 2, 0), (1, 0, 1, 1)), 3.0, (0.0, 0.0, 0.0), (2, 3))
"""Three dead ends about one crossing."""


def test_numbers_and_places_of_a_grid() -> None:
    assert GRID.intersections == tuple((x, y) for x in range(4) for y in range(3))
    assert GRID.vertex((2, 1)) == 7
    assert GRID.size == (3, 4)
    assert GRID.lanes == 34
    assert GRID.points[7].tolist() == [6.0, 3.0]
    assert GRID.degrees[[0, 1, 4]].tolist() == [2, 3, 4]
    assert GRID.lengths.tolist() == [3.0] * 17
    with pytest.raises(InputError, match="not an intersection"):
        GRID.vertex((4, 0))


def test_a_network_is_told_by_its_lattice_or_by_its_metres() -> None:
    assert GRID.summary == "17 segments, 12 intersections on a 3 x 4 lattice"
    off = RoadNetwork(((0, 0, 1.5, 0), (1.5, 0, 1.5, 2)), 4.0, (0.0, 0.0, 0.0), (3, 2))
    assert off.summary == "2 segments, 3 intersections on 6 x 8 m"


def test_transform_turns_then_shifts_and_is_not_scaled() -> None:
    network = RoadNetwork.grid(2, 2, 5.0, (1.0, 2.0, math.pi / 2))
    assert network.points[network.vertex((1, 0))] == pytest.approx([1.0, 7.0], abs=1e-12)
    assert network.points[network.vertex((0, 1))] == pytest.approx([-4.0, 2.0], abs=1e-12)
    assert network.to_lattice([[1.0, 7.0], [-4.0, 2.0]]) == pytest.approx(np.array([[1.0, 0.0], [0.0, 1.0]]))


def test_arms_stand_counter_clockwise() -> None:
    v = GRID.vertex((1, 1))
    tips = [GRID.intersections[GRID.lane_ends(lane)[1]] for lane in GRID.arms(v)]
    assert tips == [(2, 1), (1, 2), (0, 1), (1, 0)]
    assert all(GRID.lane_ends(lane)[0] == v for lane in GRID.arms(v))


def test_turning_round_only_at_a_dead_end() -> None:
    for lane in range(TEE.lanes):
        _, end = TEE.lane_ends(lane)
        assert ((lane ^ 1) in TEE.successors(lane)) == (TEE.degrees[end] == 1)
    assert TEE.successors(0) == (2, 4)
    assert TEE.successors(2) == (3,)


def test_lane_lines_lie_right_of_the_centre_line() -> None:
    network = RoadNetwork.grid(3, 4, 3.0, (2.0, -1.0, 0.7))
    for lane in range(network.lanes):
        line = network.lane_line(lane, -0.3)
        along, left = network.lane_coordinates(lane, line)
        assert along == pytest.approx([0.0, 3.0], abs=1e-12)
        assert left == pytest.approx([-0.3, -0.3], abs=1e-12)
    assert GRID.lane_line(0, -0.3) == ((0.0, -0.3), (3.0, -0.3))
    assert GRID.lane_line(1, -0.3) == ((3.0, 0.3), (0.0, 0.3))


def test_on_road_ends_in_discs() -> None:
    road = RoadNetwork.grid(1, 2)
    points = [[0.0, 0.6], [1.0, -0.6], [1.0, 0.61], [-0.6, 0.0], [-0.59, 0.3], [3.5, 0.3]]
    assert road.on_road(points, 0.6).tolist() == [True, True, False, True, False, True]


def test_nearest_takes_the_lower_number_and_any_place() -> None:
    segment, distance = GRID.nearest_segment([[-1.0, -1.0], [100.0, 3.0], [1.5, 1.5]])
    assert segment.tolist() == [0, 10, 0]
    assert distance == pytest.approx([math.sqrt(2.0), 91.0, 1.5])
    assert GRID.nearest_segment([1.5, 0.2])[0] == 0
    assert GRID.nearest_intersection([1.5, 0.0])[0] == 0
    assert GRID.nearest_intersection(np.zeros((0, 2)))[0].shape == (0,)
    assert GRID.nearest_segment([[math.nan, 0.0]])[0].tolist() == [0]


def test_routes_are_the_shortest_along_lanes() -> None:
    for network in (GRID, TEE, RoadNetwork.grid(4, 4, transform=(0, 0, 1.0))):
        for v in range(len(network.points)):
            routes = network.routes_to(v)
            assert routes is network.routes_to(v)
            for lane in range(network.lanes):
                path = routes.follow(lane)
                assert path[0] == lane
                assert network.lane_ends(path[-1])[1] == v
                for here, after in pairwise(path):
                    assert after in network.successors(here)
                length = sum(float(network.lengths[step >> 1]) for step in path)
                assert routes.distance[lane] == pytest.approx(length)
                end = network.lane_ends(lane)[1]
                best = min(routes.distance[other] for other in network.successors(lane))
                rest = 0.0 if end == v else best
                assert routes.distance[lane] == pytest.approx(network.lengths[lane >> 1] + rest)


def test_a_route_must_not_turn_round_on_the_road() -> None:
    ring = RoadNetwork.grid(2, 2)
    first = ring.successors(0)[0]
    start = ring.lane_ends(0)[0]
    assert ring.routes_to(start).distance[first] == 9.0


def test_networks_are_values() -> None:
    other = RoadNetwork.grid(3, 4)
    assert len(GRID.table(0.0).seg_start) > 1
    assert other == GRID
    assert hash(other) == hash(GRID)
    assert pickle.loads(pickle.dumps(GRID)) == GRID
    with pytest.raises(ValueError, match="read-only"):
        GRID.points[0, 0] = 1.0


def test_networks_need_no_compiler() -> None:
    program = (
        "import sys; from dubins_traffic.roads.generate import generate;"
        "from dubins_traffic.roads.clearance import clearance_faults;"
        "n = generate(12, 14, 1, rigid_motion=True); n.on_road(n.points, .6); clearance_faults(n, 1.0, .177, .3);"
        "n.routes_to(0); sys.exit('numba' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0
