"""Cars on segments that bend: what is asked of the roads, who is refused there, and how the law drives."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dubins_traffic.cars.body import Bounds, Car, DiscObstacle
from dubins_traffic.cars.state import Frames, Pose
from dubins_traffic.problem.configuration import Configuration
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import EAgent, Instance
from dubins_traffic.roads.clearance import clearance_faults
from dubins_traffic.roads.generate import generate
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.runs.single import run_trial
from dubins_traffic.runs.sources import load_record
from dubins_traffic.scoring.verdict import Verdict
from tests.chain_reference import RING, SNAKE, Track


def _network(*rows: list[float], length: float = 1.0) -> RoadNetwork:
    return RoadNetwork.from_document({"version": 2, "length": length, "segments": list(rows)})


def _configured(network: RoadNetwork, cars: int, duration: int) -> Configuration:
    agents = [{"type": "lawful", "name": "car", "count": cars}] if cars else []
    return Configuration.from_document(
        {
            "version": 1, "problem_domain": "dubins_traffic", "rnd": network.to_document(), "rules": True,
            "duration_bounds": [duration, duration], "number_goals_bounds": [2, 2], "e-agents": agents,
        }
    )  # fmt: skip


def _instance(network: RoadNetwork = RING, cars: int = 2, duration: int = 40, trial: int = 0) -> Instance:
    return draw(_configured(network, cars, duration), 3, trial)


def _driven(instance: Instance, folder: Path) -> tuple[Frames, Verdict]:
    """Return the frames of a trial with `rules`, and the verdict."""
    record = folder / "trial.mcap"
    verdict = run_trial(instance, "rules", record=record, sketch=False).score.verdict
    assert verdict is not None
    return load_record(record).frames, verdict


TIGHT = [
    ([[0, 0, 9, 0, 1.5, 0, 1, 4.5, 2, 1, 7, 0, 1]], "segments[0]", "corner 0: too near to the first end"),
    ([[0, 0, 9, 0, 2.5, 0, 1, 4.5, 2, 1, 7.8, 0, 1]], "segments[0]", "corner 2: too near to the second end"),
    ([[0, 0, 9, 0, 2.5, 0, 1, 4.5, 2, 0.8, 6.5, 0, 1]], "segments[0]", "corner 1: too sharp a curve"),
    (
        [
            [0, 0, 16, 0, 4, 0, 1, 6, 4, 1, 10, 4, 1, 12, 0, 1],
            [0, 0, 16, -4, 0, -4, 1, 4, -4, 1, 7, 3, 1, 9, 3, 1, 12, -4, 1],
        ],
        "segments[1]",
        "comes too close to segments[0]",
    ),
    (
        [[0, 0, 16, 0, 3, 0, 1, 3, 4, 1, 10, 4, 1, 10, 8, 1, 6.5, 8, 1, 6.5, 5.2, 1, -2, 5.2, 1, -2, 12, 1, 16, 12, 1]],
        "segments[0]",
        "comes too close to itself",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("rows", "field", "problem"), TIGHT)
def test_roads_that_bend_too_much_are_refused_by_segment_and_corner(rows: Any, field: str, problem: str) -> None:
    faults = clearance_faults(_network(*rows), 1.0, 0.177, 0.3)
    assert faults[0].field == field
    assert problem in str(faults[0])


def test_roads_that_bend_enough_have_no_faults() -> None:
    for network in (RING, SNAKE):
        assert clearance_faults(network, 1.0, 0.177, 0.3) == []


def test_the_generator_bends_roads_where_there_is_room() -> None:
    for seed in range(4):
        made = generate(12, 15, seed, bent=0.7, rigid_motion=True)
        assert 3 <= int(made.bent.sum()) <= 15
        assert clearance_faults(made, 1.0, 0.177, 0.3) == []
    assert generate(12, 15, 0, bent=0.7) == generate(12, 15, 0, bent=0.7)


def test_cars_start_on_the_right_lane_headed_with_it() -> None:
    for trial in range(5):
        for pose in _instance(cars=6, trial=trial).starts:
            segment = int(RING.nearest_segment([pose.x, pose.y])[0])
            foot = Track(RING, segment).foot(pose.x, pose.y)
            ahead = foot.way.real * pose.c + foot.way.imag * pose.s
            assert abs(ahead) == pytest.approx(1.0)
            assert foot.left * ahead == pytest.approx(-0.3)


def test_a_lone_car_follows_the_middle_of_its_lane_round_all_curves(tmp_path: Path) -> None:
    frames, verdict = _driven(_instance(cars=0, duration=60), tmp_path)
    tracks = [Track(RING, s) for s in range(len(RING.segments))]
    worst, round_curves = 0.0, 0
    for x, y, s in zip(frames.x[:, 0], frames.y[:, 0], frames.segment[:, 0].tolist(), strict=True):
        foot = tracks[s].foot(float(x), float(y))
        if RING.bent[s] and 1.6 < foot.along < tracks[s].length - 1.6:
            worst = max(worst, abs(abs(foot.left) - 0.3))
            round_curves += 1
    assert verdict.clean
    assert round_curves > 300
    assert worst < 0.03


def test_a_lone_car_keeps_its_line_in_a_disc_from_which_a_bent_road_leads(tmp_path: Path) -> None:
    """A road that bends ends in another direction than it begins in, and a car leaves the disc by its beginning."""
    frames, verdict = _driven(_instance(cars=0, duration=60), tmp_path)
    tracks = [Track(RING, s) for s in range(len(RING.segments))]
    worst, leaving = 0.0, 0
    for k in range(len(frames.x)):
        s = int(frames.segment[k, 0])
        foot = tracks[s].foot(float(frames.x[k, 0]), float(frames.y[k, 0]))
        ahead = foot.way.real * float(frames.c[k, 0]) + foot.way.imag * float(frames.s[k, 0])
        since = foot.along if ahead > 0.0 else tracks[s].length - foot.along
        if RING.bent[s] and 0.9 < since < 1.6:
            worst = max(worst, abs(abs(foot.left) - 0.3))
            leaving += 1
    assert verdict.clean
    assert leaving > 60
    assert worst < 0.03


@pytest.mark.parametrize("trial", range(2))
def test_rules_keeps_the_rules_on_roads_that_bend_among_lawful_cars(trial: int, tmp_path: Path) -> None:
    _, verdict = _driven(_instance(cars=4, duration=40, trial=trial), tmp_path)
    assert verdict.clean


def _on(track: Track, along: float, back: bool = False) -> Pose:
    """Return the pose in the middle of the right lane of a road, or of the lane back."""
    place, way = track.point(along)
    way = -way if back else way
    place -= 0.3j * way
    return Pose(place.real, place.imag, way.real, way.imag)


def test_a_car_behind_another_that_stands_in_a_bend_stops_and_touches_nobody(tmp_path: Path) -> None:
    track = Track(RING, 4)
    stands, comes = _on(track, 5.0), _on(track, 2.2)
    parked = (EAgent("parked", "car0", "parked", {}),)
    found = replace(_instance(cars=1), starts=(comes, stands), e_agents=parked, duration=12.0)
    frames, verdict = _driven(found, tmp_path)
    gap = np.hypot(frames.x[:, 0] - stands.x, frames.y[:, 0] - stands.y) - 2.0 * 0.177
    waits = frames.speed[:, 0] == 0.0
    assert float(gap.min()) > 0.05
    assert waits.sum() > 30
    assert (gap[waits] < 1.2).any()
    assert verdict.clean


def test_a_car_slows_where_it_could_not_turn_with_the_road(tmp_path: Path) -> None:
    found = _instance(cars=0, duration=30)
    clumsy = replace(found.problem, car=Car(bounds=Bounds(speed=0.7, yaw_rate=0.9)))
    frames, verdict = _driven(replace(found, problem=clumsy), tmp_path)
    assert verdict.clean
    assert float(frames.speed[30:, 0].min()) > 0.1 or float(frames.speed[:, 0].max()) == pytest.approx(0.7)


@pytest.mark.parametrize(("road", "back"), [(4, False), (4, True), (5, False), (0, True), (2, False)])
@pytest.mark.parametrize("what", ["disc", "parked"])
def test_what_stands_between_bends_is_passed_by_the_rules(road: int, back: bool, what: str, tmp_path: Path) -> None:
    """The ego comes up behind it, is blocked and waits, passes it on the left, and is back in its lane in time."""
    track = Track(RING, road)
    start, at = 1.4, 0.45 * track.length
    comes, there = (_on(track, track.length - own if back else own, back) for own in (start, at))
    found = _instance(cars=0)
    goals = tuple(RING.intersections[v] for v in RING.ends[road])
    problem = replace(found.problem, goals=goals)
    found = replace(found, problem=problem, starts=(comes,), duration=40.0)
    if what == "disc":
        problem = replace(problem, obstacles=(DiscObstacle(there.x, there.y, 0.12),))
        found = replace(found, problem=problem)
    else:
        agent = EAgent("parked", "car0", "parked", {"vacates_after": None})
        found = replace(found, starts=(comes, there), e_agents=(agent,))
        found = replace(found, problem=replace(problem, e_agents=("car0",)))
    frames, verdict = _driven(found, tmp_path)
    own = frames.bits[:, 0].astype(int)
    assert [one for one in verdict.violations if one.car == "ego"] == []
    blocked = int(np.flatnonzero(own & FLAG.BLOCKED)[0])
    first = track.foot(float(frames.x[blocked, 0]), float(frames.y[blocked, 0])).along
    gone = track.length - first if back else first
    assert at - 1.5 - 0.125 < gone < at
    assert (own & FLAG.LEFT != 0).any()
    assert np.hypot(frames.x[:, 0] - there.x, frames.y[:, 0] - there.y).min() > 0.12 + 0.177
    ends = RING.points[RING.ends[road, 0 if back else 1]]
    assert np.hypot(frames.x[:, 0] - ends[0], frames.y[:, 0] - ends[1]).min() < 1.0
