import time
from math import inf, nan, pi
from typing import Any

import numpy as np
import pytest

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.roads.clearance import clearance_faults
from dubins_traffic.roads.generate import generate, thinned_grid
from dubins_traffic.roads.network import RoadNetwork


@pytest.mark.parametrize("segments", [999, 1300, 1936])
def test_a_thousand_intersections_are_placed_and_checked_quickly(segments: int) -> None:
    begin = time.process_time()
    network = generate(1000, segments, 5, rigid_motion=True)
    drawn = time.process_time()
    RoadNetwork.from_document(network.to_document())
    assert clearance_faults(network, 1.0, 0.177, 0.3) == []
    checked = time.process_time()
    assert (len(network.intersections), len(network.segments)) == (1000, segments)
    assert drawn - begin < 5.0
    assert checked - drawn < 1.0


def test_bearings_vary() -> None:
    for segments in (70, 104):
        network = generate(60, segments, 1)
        bearings = np.arctan2(network.tangents[:, 1], network.tangents[:, 0])
        assert len(np.unique(bearings.round(3))) > 25


def test_a_request_that_cannot_be_placed_names_the_largest_that_was() -> None:
    with pytest.raises(InputError, match=r"at angles of at least 114\.592 degrees: got 70; expected at most \d+"):
        generate(60, 70, 0, minimum_angle=2.0)
    assert len(generate(60, 59, 0, minimum_angle=2.0).segments) == 59


BAD: list[tuple[dict[str, Any], str]] = [
    ({"intersections": 1, "segments": 0}, "intersections"),
    ({"intersections": 10**9, "segments": 10**9}, "intersections"),
    ({"segments": 10}, "segments"),
    ({"segments": 18}, "segments"),
    ({"minimum_angle": 0.0}, "minimum_angle"),
    ({"minimum_angle": nan}, "minimum_angle"),
    ({"minimum_angle": 4.0}, "minimum_angle"),
    ({"w": -0.3}, "w"),
    ({"w": inf}, "w"),
    ({"reach": -1.0}, "reach"),
    ({"radius": 0.5}, "radius"),
    ({"radius": nan}, "radius"),
]


@pytest.mark.parametrize(("wishes", "field"), BAD)
def test_bad_requests_are_refused_by_name(wishes: dict[str, Any], field: str) -> None:
    with pytest.raises(InputError) as caught:
        generate(**{"intersections": 12, "segments": 14, **wishes})
    assert caught.value.field == field
    assert caught.value.expected


def test_the_bounds_of_segments_are_said() -> None:
    with pytest.raises(InputError, match=r"got 18; expected an integer in \[11, 17\] for 12 intersections"):
        generate(12, 18)


def test_grids_lose_a_share() -> None:
    network = thinned_grid(Draws(3, 0, 1), 10, 10, 0.25, length=4.0)
    assert len(network.segments) == 180 - 45
    assert network.shape == (10, 10)
    assert network.length == 4.0
    assert thinned_grid(Draws(3, 0, 1), 3, 4, 0.0) == RoadNetwork.grid(3, 4)
    with pytest.raises(InputError, match=r"expected at most 81 of 180 segments \(0\.45\)"):
        thinned_grid(Draws(3, 0, 1), 10, 10, 0.5)
    with pytest.raises(InputError, match="not a share"):
        thinned_grid(Draws(3, 0, 1), 10, 10, nan)


def test_a_rigid_motion_when_asked() -> None:
    still, moved = generate(12, 14, 9), generate(12, 14, 9, rigid_motion=True)
    assert still.transform == (0.0, 0.0, 0.0)
    assert moved.transform != still.transform
    assert -pi <= moved.transform[2] < pi
    assert moved.segments == still.segments
