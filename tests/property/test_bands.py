"""Nearly straight, parallel, equal, touching: what divides by a difference gives finite numbers, in both tiers.

Machine code divides by 0 without a word, so the interpreted kernel, which would raise, runs beside it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from dubins_traffic.cars.body import Bounds, Car
from dubins_traffic.cars.sensing import ray_box
from dubins_traffic.cars.state import Command, Pose
from dubins_traffic.controllers.simple import _on_arc
from dubins_traffic.kernels.angles import angle
from dubins_traffic.kernels.boxes import Box, Drive, box_contact, disc_contact, separation
from dubins_traffic.policies.lanes.turns import IMPOSSIBLE, Site, shape
from dubins_traffic.policies.rules.turn_arcs import ReferencePath, on_way
from dubins_traffic.policies.waypoint import turn_or_pursue, turn_then_drive
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.protocols import End
from dubins_traffic.rules.blocking import _clipped
from dubins_traffic.runs.single import run_trial
from tests.minute import a_minute

PERIOD = 1.0 / 30.0
CARS = {
    "turns in place": Car(),
    "arcs": Car(bounds=Bounds(turning_radius=0.2)),
    "forward": Car(bounds=Bounds(turning_radius=0.2, speed_min=0.1)),
}


def small() -> st.SearchStrategy[float]:
    """Numbers near 0, of all sizes down to the least there is."""
    sizes = st.one_of(st.floats(-17.0, -5.0), st.floats(-323.0, 0.0))
    size = st.one_of(st.just(0.0), sizes.map(lambda power: 10.0**power))
    return st.tuples(st.sampled_from((-1.0, 1.0)), size).map(math.prod)


def near(*values: float) -> st.SearchStrategy[float]:
    """Numbers near some values."""
    return st.tuples(st.sampled_from(values), small()).map(sum)


def headings() -> st.SearchStrategy[tuple[float, float]]:
    return near(0.0, math.pi / 2, math.pi, -math.pi / 2, 1.0).map(lambda a: (math.cos(a), math.sin(a)))


@st.composite
def boxes(draw: st.DrawFn, *places: float) -> Box:
    x, y = draw(near(*places)), draw(near(*places))
    return Box(
        x,
        y,
        *draw(headings()),
        *(draw(st.sampled_from(sizes)) for sizes in ((0.0, 0.25), (0.0, 0.1), (0.0, 0.177))),
    )


@st.composite
def drives(draw: st.DrawFn) -> Drive:
    return Drive(draw(near(0.0, 0.5)), draw(near(0.0, 1.0)), abs(draw(near(0.0, PERIOD))))


def in_both(kernel: Callable[..., Any], *given: Any) -> list[float]:
    """Return the numbers that a kernel gives, which are the same in both tiers, and none of them not a number."""
    found = np.atleast_1d(kernel(*given)).tolist()
    plain: Any = getattr(kernel, "interpreted", kernel)
    assert np.atleast_1d(plain(*given)).tolist() == found
    assert not any(math.isnan(number) for number in found)
    return found


@settings(deadline=None, max_examples=100)
@given(near(0.0, math.pi, -math.pi), st.sampled_from(sorted(CARS)), st.sampled_from((2, 3)), st.booleans())
@example(1e-9, "turns in place", 4, False)
@example(-2e-8, "arcs", 4, False)
def test_turns_of_lanes(by: float, car: str, degree: int, visit: bool) -> None:
    turn = shape(Site(by, 6.0, 4.0, degree, 1.0, CARS[car], visit))
    numbers = [turn.before, turn.after, turn.cost, *(number for piece in turn.pieces for number in piece)]
    assert all(map(math.isfinite, numbers))
    if abs(by) < 1e-3 and not visit:
        assert turn.cost < IMPOSSIBLE
        assert abs(turn.cost) < 1e-2
        assert all(abs(piece.bend) * piece.length <= abs(by) * (1.0 + 1e-9) for piece in turn.pieces)


@settings(deadline=None, max_examples=100)
@given(boxes(0.0), boxes(0.0, 0.25, 0.354, 0.5))
def test_boxes_that_nearly_touch_or_nearly_coincide(one: Box, other: Box) -> None:
    gap, nx, ny, px, py = in_both(separation, one, other)
    assert all(map(math.isfinite, (gap, px, py)))
    assert math.hypot(nx, ny) == pytest.approx(1.0)


@settings(deadline=None, max_examples=100)
@given(boxes(0.0), drives(), boxes(0.354, 0.5), drives())
def test_bodies_that_nearly_meet(one: Box, drive: Drive, other: Box, its: Drive) -> None:
    in_both(box_contact, one, drive, other, its, 0.0, PERIOD)
    in_both(disc_contact, one, drive, other, its, 0.0, PERIOD)


@settings(deadline=None, max_examples=100)
@given(near(0.3, 0.25), near(0.0, 0.1), headings(), boxes(0.0))
def test_rays_along_a_side(x: float, y: float, way: tuple[float, float], box: Box) -> None:
    assert min(in_both(ray_box, x, y, *way, box)) >= 0.0


@settings(deadline=None, max_examples=100)
@given(small(), small(), headings(), small(), small(), st.sampled_from((0.0, 0.3)))
def test_points_to_drive_to_that_are_nearly_reached(
    x: float, y: float, way: tuple[float, float], goal_x: float, goal_y: float, radius: float
) -> None:
    pose, most = Pose(x, y, *way), Command(0.5, 3.0)
    for found in (
        in_both(turn_or_pursue, pose, goal_x, goal_y, most, 0.0, radius, PERIOD),
        in_both(turn_then_drive, pose, goal_x, goal_y, most, 0.1, 0.01, PERIOD),
    ):
        assert abs(found[0]) <= most.speed
        assert abs(found[1]) <= most.yaw_rate


@settings(deadline=None, max_examples=100)
@given(small(), small())
@example(1e-173, -1e-205)
def test_points_near_the_middle_of_an_arc(x: float, y: float) -> None:
    way = ReferencePath(0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.5, 1.0, 0.3, 2.0)
    _, key, left, px, py = in_both(on_way, way, x, y)
    assert all(map(math.isfinite, (key, left)))
    assert math.hypot(px, py) <= 1.0 + 1e-12


@settings(deadline=None, max_examples=100)
@given(small(), small())
def test_angles_of_short_vectors(x: float, y: float) -> None:
    (found,) = in_both(angle, abs(y), x)
    assert found == pytest.approx(math.atan2(abs(y), x), abs=1e-12) or (x == 0.0 == y)


@settings(deadline=None, max_examples=100)
@given(near(0.5), small(), near(0.5), small(), near(0.5), near(0.5))
def test_obstacles_that_lie_nearly_across_the_lane(
    s0: float, l0: float, s1: float, l1: float, begin: float, end: float
) -> None:
    low, high = in_both(_clipped, s0, l0, s1, l1, 0.0, begin, end)
    assert low == 1e300 or (min(l0, l1) - 1e-9 <= low <= high <= max(l0, l1) + 1e-9)


@settings(deadline=None, max_examples=100)
@given(small(), small())
@example(-1e-200, 0.0)
def test_simple_at_its_goal(ahead: float, left: float) -> None:
    speed, yaw_rate = in_both(_on_arc, ahead, left, 0.5, 0.3)
    assert speed == 0.5
    assert abs(yaw_rate) <= 0.5 / 0.3


@pytest.mark.parametrize("controller", ["lanes", "lanes+shield", "rules", "simple"])
@pytest.mark.parametrize("off", [1e-12, 2e-9, 1e-8, 6e-8, 1e-6, 1e-4])
def test_roads_that_are_nearly_straight(controller: str, off: float) -> None:
    arms = [
        [0.0, 1.0, 1.0, 1.0],
        [1.0, 1.0, 2.0, 1.0 + off],
        [1.0, 0.0, 1.0, 1.0],
        [1.0, 1.0, 1.0 - off, 2.0],
    ]
    document = a_minute("junction").to_document()
    document["rnd"] = {"version": 2, "length": 6, "segments": arms}
    ran = run_trial(draw(load_config({**document, "duration": 1.0}), seed=0, trial=0), controller)
    assert ran.ending.end is End.DURATION
