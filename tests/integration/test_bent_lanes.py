"""The controller `lanes` on roads that bend."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from dubins_traffic.cars.body import Bounds, Car
from dubins_traffic.cars.state import Pose
from dubins_traffic.policies.lanes.paths import PathMaker
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.runs.single import run_trial
from dubins_traffic.runs.sources import load_record
from tests.chain_reference import RING, SNAKE, Track

pytestmark = pytest.mark.path

W = 0.3


def _instance(network: Any, trial: int, cars: int = 0, duration: int = 60, **more: Any) -> Instance:
    agents = [{"type": "lawful", "name": "car", "count": cars}] if cars else []
    config = load_config(
        {
            "version": 1, "problem_domain": "dubins_traffic", "rnd": network.to_document(), "duration": duration,
            "number_goals_bounds": [2, 2], "e-agents": agents, **more,
        }
    )  # fmt: skip
    return draw(config, 11, trial)


@pytest.mark.parametrize("network", [RING, SNAKE], ids=["ring", "snake"])
def test_a_path_runs_along_the_middle_of_the_right_lane(network: Any) -> None:
    maker = PathMaker(_instance(network, 0).problem)
    for lane in range(network.lanes):
        following = network.successors(lane)[0]
        path = maker.path([lane, following, lane], 0.7, 1)
        track = Track(network, lane >> 1)
        rows = [row for row in path.rows if row.lane == lane][: len(path.rows)]
        gone = 0.0
        for k, row in enumerate(rows):
            foot = track.foot(row.x, row.y)
            along, left = (track.length - foot.along, -foot.left) if lane & 1 else (foot.along, foot.left)
            if k and along < gone:
                break
            gone = along
            way = -foot.way if lane & 1 else foot.way
            assert left == pytest.approx(-W, abs=1e-9)
            assert way.real * row.c + way.imag * row.s == pytest.approx(1.0)
            assert abs(row.bend) * row.length <= 0.45 + 1e-9
        assert gone > 0.5 * track.length or not network.bent[lane >> 1]


@pytest.mark.parametrize("trial", range(3))
@pytest.mark.parametrize("network", [RING, SNAKE], ids=["ring", "snake"])
def test_a_lone_car_keeps_to_the_middle_of_its_lane_round_all_curves(network: Any, trial: int, tmp_path: Path) -> None:
    record = tmp_path / "trial.mcap"
    score = run_trial(_instance(network, trial, duration=90), "lanes", record=record).score
    frames = load_record(record).frames
    tracks = [Track(network, s) for s in range(len(network.segments))]
    worst, on_curves = 0.0, 0
    for x, y, s in zip(frames.x[:, 0], frames.y[:, 0], frames.segment[:, 0].tolist(), strict=True):
        foot = tracks[s].foot(float(x), float(y))
        if network.bent[s] and 1.7 < foot.along < tracks[s].length - 1.7:
            worst = max(worst, abs(abs(foot.left) - W))
            on_curves += 1
    assert on_curves > 150
    assert worst < 0.06
    assert sum(goal.visits for goal in score.goals) >= 2
    assert score.driven.off_road_s == 0.0


@pytest.mark.parametrize("trial", range(4))
def test_it_drives_among_others_without_a_collision_of_its_own(trial: int) -> None:
    network = (RING, SNAKE)[trial % 2]
    score = run_trial(_instance(network, trial, cars=4, duration=60, rules=True), "lanes").score
    assert [one for one in score.collisions if one.at_fault] == []
    assert score.driven.off_road_s == 0.0
    assert score.driven.distance_m > 5.0


def test_a_car_on_the_wrong_side_of_a_bend_comes_back_to_its_lane(tmp_path: Path) -> None:
    track = Track(RING, 4)
    place, way = track.point(4.5)
    place += 0.25j * way
    found = _instance(RING, 0, duration=10)
    found = replace(found, starts=(Pose(place.real, place.imag, way.real, way.imag),))
    record = tmp_path / "trial.mcap"
    run_trial(found, "lanes", record=record)
    frames = load_record(record).frames
    left = [track.foot(float(x), float(y)).left for x, y in zip(frames.x[:, 0], frames.y[:, 0], strict=True)]
    assert left[0] == pytest.approx(0.25)
    assert min(abs(one + W) for one in left[60:150]) < 0.03


def test_a_car_that_turns_slowly_slows_in_curves() -> None:
    found = _instance(RING, 1, duration=60)
    clumsy = replace(found.problem, car=Car(bounds=Bounds(speed=0.7, yaw_rate=0.9)))
    score = run_trial(replace(found, problem=clumsy), "lanes").score
    assert score.driven.off_road_s == 0.0
    assert sum(goal.visits for goal in score.goals) >= 1


def test_what_stands_in_a_bend_is_passed(tmp_path: Path) -> None:
    track = Track(RING, 4)
    poses: list[Pose] = []
    for along in (2.2, 5.0):
        place, way = track.point(along)
        place -= 1j * W * way
        poses.append(Pose(place.real, place.imag, way.real, way.imag))
    parked = {"type": "parked", "name": "car", "parameters": {"vacates_after": None}}
    found = replace(_instance(RING, 0, duration=30, **{"e-agents": [parked]}), starts=tuple(poses))
    record = tmp_path / "trial.mcap"
    score = run_trial(found, "lanes", record=record).score
    frames = load_record(record).frames
    seen = zip(frames.x[:, 0], frames.y[:, 0], frames.segment[:, 0], strict=True)
    assert max(track.foot(float(x), float(y)).along for x, y, s in seen if s == 4) > 6.5
    assert list(score.collisions) == []
