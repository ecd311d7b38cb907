import json
import math
from typing import Any

import numpy as np
import pytest

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.angles import angle
from dubins_traffic.roads.network import RoadNetwork

BENT = RoadNetwork(
    segments=((0, 0, 4, 2), (4, 2, 8, 2), (4, 2, 4, 6.5)),
    length=1.5,
    transform=(1.0, 2.0, 0.3),
    shape=(7, 9),
    corners=(((2, 0, 0.5), (2, 2, 0.5)), (), ((5, 4, 1),)),
)


def _network(*rows: list[float]) -> RoadNetwork:
    return RoadNetwork.from_document({"version": 2, "length": 3, "segments": list(rows)})


def test_angles_are_those_of_atan2() -> None:
    draws = np.random.default_rng(0).uniform(0.0, math.pi, 2000)
    for theta in [0.0, 0.5 * math.pi, math.pi, *draws.tolist()]:
        y, x = abs(math.sin(theta)), math.cos(theta)
        assert abs(angle(y, x) - math.atan2(y, x)) <= 4e-16 * math.pi
    assert angle(0.0, 0.0) == 0.0


def test_version_2_comes_back_as_it_was() -> None:
    assert BENT.to_document()["version"] == 2
    assert BENT.to_document()["segments"][0] == [0, 0, 4, 2, 2, 0, 0.5, 2, 2, 0.5]
    assert RoadNetwork.from_text(BENT.to_text()) == BENT
    assert RoadNetwork.from_text(BENT.to_json()) == BENT
    assert json.loads(BENT.to_json())["segments"][1] == [4, 2, 8, 2]


def test_a_version_2_that_version_0_could_say_is_written_as_that() -> None:
    made = _network([0, 0, 1, 0], [1, 0, 2.0, 0])
    assert made == RoadNetwork(((0, 0, 1, 0), (1, 0, 2, 0)), 3.0, (0.0, 0.0, 0.0), (1, 3), corners=((), ()))
    assert made.to_document()["version"] == 0


def test_a_chain_is_as_long_as_its_lines_and_arcs() -> None:
    straight = 2.0 + 2.0 + 2.0 - 4.0 * 0.5
    assert BENT.lengths[0] == pytest.approx(1.5 * (straight + 2.0 * 0.5 * 0.5 * math.pi))
    assert BENT.lengths[1] == 6.0
    assert BENT.bent.tolist() == [True, False, True]


def test_arms_are_in_the_order_in_which_roads_leave() -> None:
    curled = _network([0, 0, 4, 0], [0, 0, 4, 1, 0, 4, 1, 4, 4, 1], [0, 0, -4, 0])
    assert curled.arms(curled.vertex((0, 0))) == (0, 2, 4)
    assert curled.tangents[1] == pytest.approx([0.0, 1.0])
    assert curled.end_tangents[1] == pytest.approx([0.0, -1.0])


def test_the_middle_line_of_a_lane_keeps_its_distance() -> None:
    line = BENT.lane_curve(0, -0.3, 0.001)
    _, off = BENT.lane_coordinates(0, line[1:-1])
    assert np.abs(off + 0.3).max() < 1e-9
    assert BENT.lane_curve(1, 0.3, 0.001)[::-1] == pytest.approx(line)


BAD: list[tuple[list[list[Any]], str, str]] = [
    ([[0, 0, 4, 0, 2, 2]], "segments[0]", "not a segment"),
    ([[0, 0, 4, 0, 2, 2, -1]], "segments[0]", "corner 0: not a corner"),
    ([[0, 0, 4, 0, 2, 2, "r"]], "segments[0]", "corner 0: not a corner"),
    ([[0, 0, 4, 0], [4, 0, 8, 0, 6, 2, 9]], "segments[1]", "corner 0: the arc does not fit"),
    ([[0, 0, 8, 0, 2, 2, 1, 4, 2, 8]], "segments[0]", "corners 0 and 1: the arcs overlap"),
    ([[0, 0, 8, 0, 4, 0, 1, 2, 0, 1]], "segments[0]", "corner 0: turns straight back"),
    ([[0, 0, 8, 0, 0, 0, 1]], "segments[0]", "corner 0: lies on the point next to it"),
    ([[0, 0, 4, 0], [4, 0, 0, 1, 4, 4, 0.1, 2, -2, 0.1]], "segments[1]", "meets segments[0]"),
    ([[0, 0, 6, 6, 6, 0, 1, 6, 4, 1, 2, 4, 1, 2, -2, 1, 9, -2, 1, 9, 6, 1]], "segments[0]", "crosses itself"),
    ([[0, 0, 4, 0], [2, 0, 2, 4.5]], "segments[1]", "meets segments[0]"),
    ([[0, 0, 4, 0.5], [0, 0, 8, 1]], "segments[1]", "meets segments[0]"),
    ([[0, 0, 4, 4, 4, 0, 3], [0, 0, 4, 4, 0, 4, 3]], "segments[1]", "the same road as segments[0]"),
]


@pytest.mark.parametrize(("rows", "field", "problem"), BAD)
def test_what_is_no_network_is_refused_by_segment_and_corner(rows: Any, field: str, problem: str) -> None:
    with pytest.raises(InputError) as caught:
        _network(*rows)
    assert caught.value.field == field
    assert problem in str(caught.value)


def test_roads_may_bend_round_each_other() -> None:
    _network([0, 0, 8, 0, 2, 2, 1, 6, 2, 1], [0, 0, 8, 0.5, 2, 4, 1, 6, 4, 1])


@pytest.mark.parametrize("last", [[4.0, 2.0], [-4.0, 2.0]])
def test_arcs_with_hardly_a_line_between_them_do_not_cross(last: list[float]) -> None:
    """A document may have been rounded: what is left of a side that two arcs shared is no crossing."""
    for gap in (1e-9, 1e-8, 1e-7, 1e-6, 1e-5):
        radius = 1.0 - 0.5 * gap
        made = _network([-4.0, 0.0, *last, 2, 0, radius, 2, 2, radius])
        assert len(made.chains.owner) in (4, 5)
