"""Surrogate safety measures of pairs for which they can be told by hand, and by slow words of their definitions."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dubins_traffic.cars.state import Frames
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.reader import read
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.blocks import cut
from dubins_traffic.surrogates.pairs import Others, others_of, touching_distance
from dubins_traffic.surrogates.post_encroachment import HORIZON, PostEncroachment
from dubins_traffic.surrogates.responsibility import ResponsibilitySensitiveSafety, Safe
from dubins_traffic.surrogates.time_to_collision import time_to_touch
from tests.recordings import make_frames, make_instance

PAIRS = {
    "head on": ((10.0, 0.0, -2.0, 0.0), 4.5),
    "already touching": ((0.6, 0.8, 5.0, 5.0), 0.0),
    "just touching, driving apart": ((1.0, 0.0, 1.0, 0.0), 0.0),
    "driving apart": ((10.0, 0.0, 2.0, 0.0), math.inf),
    "standing": ((10.0, 0.0, 0.0, 0.0), math.inf),
    "passing by at a distance": ((10.0, 1.5, -2.0, 0.0), math.inf),
    "off the middle": ((5.0, 0.6, -1.0, 0.0), 4.2),
    "from the side": ((3.0, 4.0, -0.6, -0.8), 4.0),
    "far and slow": ((1e6, 0.0, -1e-3, 0.0), (1e6 - 1.0) / 1e-3),
}


@pytest.mark.parametrize("pair", PAIRS)
def test_time_until_a_pair_touches(pair: str) -> None:
    place, expected = PAIRS[pair]
    x, y, vx, vy = (np.array([[value]]) for value in place)
    assert time_to_touch(Others(x, y, vx, vy), 1.0)[0, 0] == pytest.approx(expected, rel=1e-12)


RATE = 30.0
TOUCH = touching_distance(make_instance().problem)


def of_frames(metric: Any, instance: Instance, frames: Frames) -> dict[str, Any]:
    """Return what a metric tells of some frames, handed over in blocks of a second."""
    metric.begin(instance)
    for first in range(0, len(frames), 30):
        metric.frames(cut(frames, first, min(first + 30, len(frames))))
    return dict(metric.result())


def straight(x: float, y: float, vx: float, vy: float, ticks: int) -> list[tuple[float, float]]:
    """Return the places of a car that drives straight."""
    return [(x + vx * k / RATE, y + vy * k / RATE) for k in range(ticks)]


def encroachment(*cars: list[tuple[float, float]]) -> float | None:
    """Return the least post-encroachment time among an ego and others."""
    instance = make_instance(names=[f"agent{k}" for k in range(len(cars) - 1)], ticks=len(cars[0]) - 1)
    return of_frames(PostEncroachment(), instance, make_frames(instance, *cars))["min_post_encroachment_s"]


def test_behind_a_car_the_post_encroachment_time_is_the_time_gap() -> None:
    """The follower comes to where the other one has been when it has driven the gap between the discs."""
    gap, speed = 0.5, 0.6
    ahead, behind = straight(TOUCH + gap, 0.0, speed, 0.0, 200), straight(0.0, 0.0, speed, 0.0, 200)
    assert encroachment(behind, ahead) == encroachment(ahead, behind) == pytest.approx(gap / speed, abs=1 / RATE)


@pytest.mark.parametrize("late", [0.8, 2.0, 5.0])
def test_at_a_crossing_it_is_the_time_from_when_one_has_left_to_when_the_other_comes(late: float) -> None:
    """On ways that cross at right angles the discs are apart by the touching distance along both of them at most."""
    first = straight(-1.0, 0.0, 1.0, 0.0, 300)
    second = straight(0.0, -1.0 - late, 0.0, 1.0, 300)
    wanted = late - math.sqrt(2.0) * TOUCH  # the discs are nearest where both are as far from the crossing
    assert encroachment(first, second) == encroachment(second, first) == pytest.approx(wanted, abs=2 / RATE)


def test_who_never_comes_where_another_was_has_none() -> None:
    side_by_side = straight(0.0, 0.0, 0.5, 0.0, 90), straight(0.0, 1.1 * TOUCH, 0.5, 0.0, 90)
    assert encroachment(*side_by_side) is None
    assert encroachment(straight(0.0, 0.0, 0.5, 0.0, 90)) is None
    later = int((HORIZON + 4.0) * RATE)
    slow = straight(-2.0, 0.0, 2.0 / HORIZON / 1.3, 0.0, later)
    assert encroachment(slow, straight(0.0, 0.0, 1.0, 0.0, later)) is None
    assert encroachment(straight(0.0, 0.0, 0.5, 0.0, 9), straight(0.5 * TOUCH, 0.0, 0.5, 0.0, 9)) == 0.0


def test_in_trials_it_is_the_least_over_all_pairs_of_frames(tmp_path: Path) -> None:
    """Of all frames of the ego and of another, at most ten seconds apart, in which their discs would overlap."""
    found: list[float | None] = []
    for trial in range(3):
        instance = replace(draw(load_config("town"), 3, trial), duration=25.0)
        run_trial(instance, "rules", record=tmp_path / f"{trial}.mcap")
        frames = read(tmp_path / f"{trial}.mcap").frames
        ticks = np.arange(len(frames))
        apart = np.abs(ticks[:, None] - ticks)
        least = math.inf
        for car in range(1, frames.x.shape[1]):
            x, y = (row[:, 0, None] - row[:, car] for row in (frames.x, frames.y))
            meets = (np.hypot(x, y) < touching_distance(instance.problem)) & (apart <= HORIZON * RATE)
            least = min(least, apart[meets].min(initial=10**6))
        found.append(of_frames(PostEncroachment(), instance, frames)["min_post_encroachment_s"])
        assert found[-1] == (None if least == 10**6 else least / RATE)
    assert any(value is not None for value in found)


def test_the_safe_distances_are_those_of_the_paper() -> None:
    """Where the top speed is far: Definition 1 behind a car, and Definition 2 toward one."""
    rho, gain, brake, ego, other = 0.5, 1.5, 3.0, 1.2, 0.9
    safe = Safe(100.0)
    later, others = ego + rho * gain, other + rho * gain
    behind = ego * rho + 0.5 * gain * rho**2 + later**2 / (2 * brake) - other**2 / (2 * brake)
    toward = (ego + later) / 2 * rho + later**2 / (2 * brake) + (other + others) / 2 * rho + others**2 / (2 * brake)
    given = np.array([ego, ego, 0.0]), np.array([other, -other, 9.0])
    assert safe.distance(*given) == pytest.approx([behind, toward, 0.0])


def test_no_car_is_thought_to_drive_faster_than_it_can() -> None:
    """From 0.6 to 0.7 m/s in a fifteenth of a second, the rest of half a second at that, and then it brakes."""
    rising = (0.7 - 0.6) / 1.5
    assert Safe(0.7).path(np.array([0.6])) == pytest.approx([0.65 * rising + 0.7 * (0.5 - rising) + 0.7**2 / 6.0])


@pytest.mark.parametrize(
    ("other", "speed", "heading", "in_way"),
    [
        ((2.0, 0.0), 0.3, 1.0, True),  # ahead, the same way
        ((2.0, 0.0), 0.3, -1.0, True),  # ahead, toward the ego
        ((-2.0, 0.0), 0.3, 1.0, False),  # behind
        ((2.0, 1.01 * TOUCH), 0.3, 1.0, False),  # passes by
    ],
)
def test_the_margin_is_what_the_discs_are_farther_apart(
    other: tuple[float, float], speed: float, heading: float, in_way: bool
) -> None:
    instance = make_instance(names=["agent0"], ticks=1)
    frames = make_frames(instance, [(0.0, 0.0)], [other])
    frames.speed[:] = ((0.5, speed),)
    frames.c[:], frames.s[:] = ((1.0, heading),), 0.0
    told = of_frames(ResponsibilitySensitiveSafety(), instance, frames)
    safe = Safe(instance.problem.car.bounds.speed)
    asked = float(safe.distance(np.array(0.5), np.array(speed * heading)))
    assert told["min_rss_margin_m"] == (pytest.approx(2.0 - TOUCH - asked) if in_way else None)
    assert told["below_rss_share"] == float(in_way and asked > 2.0 - TOUCH)
    frames.speed[:] = ((0.0, speed),)
    standing = of_frames(ResponsibilitySensitiveSafety(), instance, frames)
    assert standing == {"min_rss_margin_m": None, "below_rss_share": 0.0}


def test_who_reverses_looks_back() -> None:
    instance = make_instance(names=["agent0"], ticks=1)
    frames = make_frames(instance, [(0.0, 0.0)], [(-1.0, 0.0)])
    frames.speed[:] = ((-0.5, 0.0),)
    frames.c[:], frames.s[:] = 1.0, 0.0
    assert others_of(frames).vx.tolist() == [[0.5]]
    asked = float(Safe(instance.problem.car.bounds.speed).distance(np.array(0.5), np.array(0.0)))
    told = of_frames(ResponsibilitySensitiveSafety(), instance, frames)
    assert told["min_rss_margin_m"] == pytest.approx(1.0 - TOUCH - asked)
