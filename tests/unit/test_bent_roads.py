"""Cars on segments that bend: what is asked of the roads, who is refused there, and how the law drives."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dubins_traffic.cars.body import Bounds, Car, DiscObstacle
from dubins_traffic.cars.state import Frames, Pose
from dubins_traffic.controllers.lanes import Lanes
from dubins_traffic.errors import InputError
from dubins_traffic.observations.flat import FlatObserver
from dubins_traffic.problem.configuration import Configuration
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import EAgent, Instance
from dubins_traffic.roads.clearance import clearance_faults
from dubins_traffic.roads.generate import generate
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.runs.single import run_trial
from dubins_traffic.runs.sources import load_record
from dubins_traffic.scoring.verdict import Verdict
from dubins_traffic.shield.filter import ShieldFilter
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
    ([[0, 0, 9, 0, 2.5, 0, 1, 4.5, 2, 0.8, 6.5, 0, 1]], "segments[0]", "corner 1: too sharp a bend"),
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
def test_roads_that_bend_too_much_are_refused_by_segment_and_corner(
    rows: Any, field: str, problem: str
) -> None:
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


@pytest.mark.parametrize("kind", ["wander", "loop", "follow"])
def test_who_knows_straight_roads_only_is_refused(kind: str) -> None:
    found = _instance()
    with pytest.raises(InputError, match="can't drive on segments that bend"):
        replace(found, e_agents=(EAgent(kind, "car0", kind), *found.e_agents[1:]))


def test_what_knows_straight_roads_only_says_so() -> None:
    problem = _instance().problem
    for made in (
        lambda: Lanes().start(problem),
        lambda: FlatObserver(problem),
        lambda: ShieldFilter().start(problem),
    ):
        with pytest.raises(InputError, match="knows straight segments only"):
            made()
    crowded = replace(problem, obstacles=(DiscObstacle(5.0, 5.0, 0.1),))
    with pytest.raises(InputError, match="no obstacles where segments bend"):
        replace(_instance(), problem=crowded)


def test_cars_start_on_the_right_lane_headed_with_it() -> None:
    for trial in range(5):
        for pose in _instance(cars=6, trial=trial).starts:
            segment = int(RING.nearest_segment([pose.x, pose.y])[0])
            foot = Track(RING, segment).foot(pose.x, pose.y)
            ahead = foot.way.real * pose.c + foot.way.imag * pose.s
            assert abs(ahead) == pytest.approx(1.0)
            assert foot.left * ahead == pytest.approx(-0.3)


def test_a_lone_car_follows_the_middle_of_its_lane_round_all_bends(tmp_path: Path) -> None:
    frames, verdict = _driven(_instance(cars=0, duration=60), tmp_path)
    tracks = [Track(RING, s) for s in range(len(RING.segments))]
    worst, round_bends = 0.0, 0
    for x, y, s in zip(frames.x[:, 0], frames.y[:, 0], frames.segment[:, 0].tolist(), strict=True):
        foot = tracks[s].foot(float(x), float(y))
        if RING.bent[s] and 1.6 < foot.along < tracks[s].length - 1.6:
            worst = max(worst, abs(abs(foot.left) - 0.3))
            round_bends += 1
    assert verdict.clean
    assert round_bends > 300
    assert worst < 0.03


@pytest.mark.parametrize("trial", range(2))
def test_rules_keeps_the_rules_on_roads_that_bend_among_lawful_cars(trial: int, tmp_path: Path) -> None:
    _, verdict = _driven(_instance(cars=4, duration=40, trial=trial), tmp_path)
    assert verdict.clean


def _on(track: Track, along: float) -> Pose:
    """Return the pose in the middle of the right lane of a road."""
    place, way = track.point(along)
    place -= 0.3j * way
    return Pose(place.real, place.imag, way.real, way.imag)


def test_a_car_behind_another_that_stands_in_a_bend_stops_and_touches_nobody(tmp_path: Path) -> None:
    track = Track(RING, 4)
    stands, comes = _on(track, 5.0), _on(track, 2.2)
    parked = (EAgent("parked", "car0", "parked", {}),)
    found = replace(_instance(cars=1), starts=(comes, stands), e_agents=parked, duration=12.0)
    frames, verdict = _driven(found, tmp_path)
    gap = float(np.hypot(frames.x[-1, 0] - stands.x, frames.y[-1, 0] - stands.y)) - 2.0 * 0.177
    assert 0.05 < gap < 1.2
    assert verdict.clean


def test_a_car_slows_where_it_could_not_turn_with_the_road(tmp_path: Path) -> None:
    found = _instance(cars=0, duration=30)
    clumsy = replace(found.problem, car=Car(bounds=Bounds(speed=0.7, yaw_rate=0.9)))
    frames, verdict = _driven(replace(found, problem=clumsy), tmp_path)
    assert verdict.clean
    assert float(frames.speed[30:, 0].min()) > 0.1 or float(frames.speed[:, 0].max()) == pytest.approx(0.7)
