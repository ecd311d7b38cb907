from math import cos, radians, sin

import pytest

from dubins_traffic.errors import InputError
from dubins_traffic.problem.document import instance_from_document
from dubins_traffic.roads.clearance import clearance_faults, clearances
from dubins_traffic.roads.network import RoadNetwork

STILL = (0.0, 0.0, 0.0)


def _faults(network: RoadNetwork, radius: float = 1.0) -> list[str]:
    return [str(fault) for fault in clearance_faults(network, radius, 0.177, 0.3)]


def test_what_the_rules_demand() -> None:
    assert clearances(1.0, 0.177, 0.3) == pytest.approx((2.854, 2.354, 1.777, cos(radians(61.298))), abs=1e-4)


def test_the_grids_of_2016_have_room() -> None:
    assert _faults(RoadNetwork.grid(3, 4)) == []
    assert _faults(RoadNetwork.grid(3, 4, 2.854)) == []


def test_faults_name_the_place() -> None:
    short = RoadNetwork(((0, 0, 1, 0), (1, 0, 4, 0)), 2.5, STILL, (1, 5))
    assert _faults(short) == ["segments[0]: too short: got 2.5; expected at least 2.854 m"]
    close = RoadNetwork(((0, 0, 40, 0), (40, 0, 40, 40), (40, 40, 0, 40), (0, 40, 0, 20)), 0.1, STILL, (41, 41))
    assert _faults(close) == [
        "segments[3]: too short: got 2.0; expected at least 2.854 m",
        "segments[0]: intersections [0, 0] and [0, 20] are too close: got 2.0; expected at least 2.354 m",
        "segments[3]: intersections [0, 20] and [0, 40] are too close: got 2.0; expected at least 2.354 m",
    ]
    hook = ((0, 0, 80, 0), (80, 0, 80, 40), (80, 40, 40, 40), (40, 40, 40, 15))
    beside = RoadNetwork(hook, 0.1, STILL, (41, 81))
    assert _faults(beside) == [
        "segments[3]: too short: got 2.5; expected at least 2.854 m",
        "segments[0]: intersection [40, 15] is too close to the road: got 1.5; expected at least 1.777 m",
    ]
    assert _faults(RoadNetwork.grid(3, 4), radius=0.8) == [
        "intersection_radius: too small: got 0.8; expected at least 2.9 w = 0.87 m"
    ]


def _fork(degrees: float) -> RoadNetwork:
    """Return a road with another that turns off at an angle, 1,000 lattice units of 4 mm long."""
    turned = (round(1000 * cos(radians(degrees))), round(1000 * sin(radians(degrees))))
    rows = max(turned[1], 0) - min(turned[1], 0) + 1
    return RoadNetwork(((0, 0, 1000, 0), (0, 0, *turned)), 0.004, STILL, (rows, 1001 - min(turned[0], 0)))


def test_arms_between_which_a_car_fits_are_refused() -> None:
    assert _faults(_fork(62.0)) == []
    assert _faults(_fork(118.0)) == []
    assert _faults(_fork(60.0)) == [
        "segments[1]: too sharp an angle with segments[0] at [0, 0]: got 60.0; expected more than 61.3 degrees"
    ]
    assert len(_faults(_fork(-60.0))) == 1
    assert _faults(_fork(62.0), radius=0.9)[0].endswith("got 62.03; expected more than 67.71 degrees")


def test_a_problem_with_rules_on_sharp_arms_is_refused() -> None:
    fork = _fork(60.0)
    rnd = {"version": 0, "length": 0.004, "transform": [0, 0, 0], "shape": list(fork.shape)}
    document = {
        "version": 1,
        "rnd": {**rnd, "segments": [list(segment) for segment in fork.segments]},
        "goals": [[1000, 0]],
        "intersection_radius": 1.0,
    }
    instance_from_document(document)
    with pytest.raises(InputError, match=r"rnd\.segments\[1\]: the rules are not defined here: too sharp an angle"):
        instance_from_document({**document, "rules": True})
