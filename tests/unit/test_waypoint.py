import math

import pytest

from dubins_traffic.cars.state import Command, Pose
from dubins_traffic.kernels.boxes import NEVER
from dubins_traffic.kernels.trig import advance, sincos
from dubins_traffic.policies.waypoint import pursue, turn_then_drive

PERIOD = 1 / 30
TAN_WANDER = math.tan(0.07)
"""Of the bearing tolerance of the e-agent of 2016."""
ORIGIN = Pose(0.0, 0.0, 1.0, 0.0)
MOST = Command(0.5, 0.9)


def law(error, distance=2.0, heading=0.3, miss=NEVER, period=PERIOD):
    """Return the command for a goal at a bearing error and a distance."""
    goal = (distance * math.cos(heading + error), distance * math.sin(heading + error))
    return turn_then_drive(Pose(0.0, 0.0, *sincos(heading)), *goal, MOST, TAN_WANDER, miss, period)


@pytest.mark.parametrize("side", [1, -1])
def test_turns_above_the_tolerance_and_drives_below(side) -> None:
    assert law(side * (0.07 - 1e-9)) == (0.5, 0.0)
    assert law(side * (0.07 + 1e-9)) == (0.0, side * 0.9)
    assert law(side * 1.6) == (0.0, side * 0.9)
    assert law(side * 3.1) == (0.0, side * 0.9)


def test_turns_right_when_the_goal_is_straight_behind() -> None:
    assert turn_then_drive(ORIGIN, -1.0, 0.0, MOST, TAN_WANDER, NEVER, PERIOD) == (0.0, -0.9)


def test_stands_on_the_goal() -> None:
    assert turn_then_drive(Pose(1.0, 2.0, 0.6, 0.8), 1.0, 2.0, MOST, TAN_WANDER, NEVER, PERIOD) == (0.0, 0.0)


def test_does_not_overshoot_at_a_low_rate() -> None:
    assert law(0.0, distance=0.2, period=1.0)[0] == pytest.approx(0.2)
    _, turn = law(0.2, period=0.5)
    assert 0.0 < turn * 0.5 <= 0.2
    assert turn * 0.5 == pytest.approx(math.sin(0.2))


def test_far_goals_are_aimed_at_more_finely() -> None:
    assert law(0.05, distance=10.0, miss=0.6) == (0.5, 0.0)
    assert law(0.05, distance=10.0, miss=0.4) == (0.0, 0.9)


@pytest.mark.parametrize("bearing", [-1.2, -0.3, 0.0, 0.4, 1.5])
def test_pursuit_goes_through_the_goal(bearing) -> None:
    goal = (0.4 * math.cos(bearing), 0.4 * math.sin(bearing))
    speed, turn = pursue(ORIGIN, *goal, Command(0.5, 10.0), 0.0, 0.0)
    pose = (0.0, 0.0, 1.0, 0.0)
    nearest = 1.0
    for _ in range(2000):
        pose = advance(*pose, speed, turn, 1e-3)
        nearest = min(nearest, math.dist(pose[:2], goal))
    assert speed == 0.5
    assert nearest < 3e-4


def test_pursuit_keeps_to_the_radius_and_slows_for_the_yaw_rate() -> None:
    nimble, slow = Command(0.5, 10.0), Command(0.5, 0.2)
    assert pursue(ORIGIN, 0.1, 0.5, nimble, 0.0, 0.8) == pytest.approx((0.5, 0.5 / 0.8))
    assert pursue(ORIGIN, -1.0, 0.0, nimble, 0.0, 0.8) == pytest.approx((0.5, 0.5 / 0.8))
    assert pursue(ORIGIN, 0.0, -1.0, slow, 0.0, 0.0) == pytest.approx((0.1, -0.2))
    assert pursue(ORIGIN, 0.0, -1.0, slow, 0.3, 0.0) == pytest.approx((0.3, -0.2))
    assert pursue(Pose(1.0, 1.0, 1.0, 0.0), 1.0, 1.0, Command(0.5, 1.0), 0.0, 0.0) == (0.5, 0.0)
