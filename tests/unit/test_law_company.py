"""What cars that keep the rules do about an odd ego and about obstacles."""

from __future__ import annotations

import math
from typing import Any

import pytest

from dubins_traffic.cars.state import Command, Observation
from dubins_traffic.errors import InputError
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance, Problem
from dubins_traffic.record.sink import Frames
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.score import Score
from tests.minute import a_minute
from tests.unit.test_law import W, broken, car, on_grid, turned


class Stands:
    """An ego that never moves."""

    def start(self, problem: Problem) -> None:
        """Nothing to prepare."""

    def act(self, _observation: Observation) -> Command:
        """Stand."""
        return Command(0.0, 0.0)


class Watch:
    """Keeps the frames of a trial."""

    def __init__(self) -> None:
        self.frames_seen: list[Frames] = []

    def begin(self, instance: Instance) -> None:
        """Nothing to prepare."""

    def frames(self, frames: Frames) -> None:
        """Keep a block."""
        self.frames_seen.append(frames)

    def end(self, ending: Any) -> None:
        """Nothing to end."""


def breaches(score: Score) -> list[tuple[str, str]]:
    """Return what e-agents have broken."""
    assert score.verdict is not None
    return [(one.rule, one.car) for one in score.verdict.violations if one.car != "ego"]


def test_nobody_enters_a_bend_in_which_the_ego_stands() -> None:
    """The bend is at (0, 12) of the grid; the ego's tail is in its disc, on the way out."""
    ego = turned(1.05, 12.0 - W)
    watch = Watch()
    behind = car("lawful", "behind", turned(W, 9.0, 0.5 * math.pi))
    instance = on_grid([behind], 100.0, ego)
    score = run_trial(instance, Stands(), sinks=[watch]).score
    assert breaches(score) == []
    bend = int(watch.frames_seen[0].crosses[0, 0])
    assert bend >= 0
    assert all(not (block.crosses[:, 1] == bend).any() for block in watch.frames_seen)


def test_nobody_passes_an_ego_that_stands() -> None:
    behind = car("lawful", "behind", turned(1.4, -W))
    score = run_trial(on_grid([behind], 80.0, turned(3.0, -W)), Stands()).score
    assert breaches(score) == []
    assert score.collisions == ()


@pytest.mark.parametrize("behind", [0.4, 0.9, 1.3])
def test_an_obstacle_is_passed_though_the_ego_stands_behind(behind: float) -> None:
    """Else both would wait for ever: the ego, as an e-agent does, for the car before it to go on."""
    x, y, _ = turned(3.5, -W)
    disc = {"disc": {"x": x, "y": y, "radius": 0.1}}
    one = car("lawful", "one", turned(2.6, -W))
    watch = Watch()
    instance = on_grid([one], 80.0, turned(2.6 - behind, -W), obstacles=[disc])
    score = run_trial(instance, Stands(), sinks=[watch]).score
    assert breaches(score) == []
    last = watch.frames_seen[-1]
    assert math.hypot(last.x[-1, 1] - x, last.y[-1, 1] - y) > 2.0


def test_an_obstacle_behind_a_crossing_is_not_driven_to() -> None:
    """Of the three ways on from the crossing at (6, 0) one is barred just behind it."""
    x, y, _ = turned(7.4, -W)
    disc = {"disc": {"x": x, "y": y, "radius": 0.15}}
    cars = [car("lawful", f"c{k}", turned(2.0 + k, -W)) for k in range(3)]
    score = run_trial(on_grid(cars, 120.0, turned(3.0, 12.0 - W), obstacles=[disc]), "rules").score
    assert breaches(score) == []


@pytest.mark.parametrize("left", [0.05, 0.15])
def test_what_leaves_room_on_the_right_is_passed_there(left: float) -> None:
    """It stands on the centre line and narrows no lane: nobody may linger before it."""
    x, y, _ = turned(3.0, -W + 0.15 + left)
    disc = {"disc": {"x": x, "y": y, "radius": 0.15}}
    one = car("lawful", "one", turned(1.4, -W))
    watch = Watch()
    instance = on_grid([one], 30.0, turned(3.0, 12.0 - W), obstacles=[disc])
    score = run_trial(instance, Stands(), sinks=[watch]).score
    assert breaches(score) == []
    last = watch.frames_seen[-1]
    assert math.hypot(last.x[-1, 1] - x, last.y[-1, 1] - y) > 2.0


def test_a_car_passes_between_two_obstacles() -> None:
    """One is on the centre line, the other at the edge of the road: the lane's middle is barred, not the lane."""
    one = car("lawful", "one", turned(1.4, -W))
    discs: list[dict[str, Any]] = []
    for along, left, radius in ((3.0, 0.03, 0.08), (3.24, -0.54, 0.06)):
        x, y, _ = turned(along, left)
        discs.append({"disc": {"x": x, "y": y, "radius": radius}})
    watch = Watch()
    instance = on_grid([one], 30.0, turned(3.0, 12.0 - W), obstacles=discs)
    score = run_trial(instance, Stands(), sinks=[watch]).score
    assert breaches(score) == []
    x, y, _ = turned(3.0, 0.0)
    last = watch.frames_seen[-1]
    assert math.hypot(last.x[-1, 1] - x, last.y[-1, 1] - y) > 2.0


def test_lawful_cars_start_on_lanes_without_obstacles() -> None:
    x, y, _ = turned(3.0, -W)
    disc = {"disc": {"x": x, "y": y, "radius": 0.15}}
    document = {
        "version": 1,
        "problem_domain": "dubins_traffic",
        "rnd": {"version": 0, "length": 6.0, "shape": [1, 2], "transform": [0.0, 0.0, 0.4]},
        "e-agents": [{"type": "lawful", "name": "car", "count": 2}],
        "goals": [[1, 0]],
        "number_trials": 1,
        "duration": 5.0,
        "obstacles": [disc],
        "rules": True,
    }
    for trial in range(6):
        instance = draw(load_config(document), 3, trial)
        for pose in instance.starts[1:]:
            assert pose.c * math.cos(0.4) + pose.s * math.sin(0.4) < 0.0


def test_who_departs_later_parks_lawfully_first() -> None:
    van = car("lawful", "van", turned(3.0, -W), departs_after=20.0)
    watch = Watch()
    score = run_trial(on_grid([van], 40.0, turned(3.0, 12.0 - W)), Stands(), sinks=[watch]).score
    assert breaches(score) == []
    moved = [bool((block.speed[:, 1] != 0.0).any()) for block in watch.frames_seen if block.first < 590]
    ends = watch.frames_seen[-1]
    assert not any(moved[:-2])
    assert math.hypot(ends.x[-1, 1] - watch.frames_seen[0].x[0, 1], ends.y[-1, 1]) > 1.0


def test_nobody_parks_longer_than_the_rules_allow() -> None:
    with pytest.raises(InputError, match="departs_after"):
        on_grid([car("lawful", "van", turned(3.0, -W), departs_after=51.0)], 40.0, turned(3.0, 12.0 - W))


def test_town_is_lawful_traffic() -> None:
    town = a_minute("town")
    for trial in range(4):
        score = run_trial(draw(town, 1, trial), "rules").score
        assert score.verdict is not None
        assert score.verdict.violations == ()


def test_wanderers_break_the_assumption() -> None:
    wanderers = a_minute("wanderers")
    scores = [run_trial(draw(wanderers, 1, trial), "rules").score for trial in range(3)]
    assert any(broken(score, name) for score in scores for name in ("wanderer0", "bus", "van"))
