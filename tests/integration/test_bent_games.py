"""Strategies and counterstrategies of the game of cells on roads that bend: the game is that of straight roads."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from experiments.synthesized import Events, instance

from dubins_traffic.cars.state import Pose
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.roads.generate import generate
from dubins_traffic.runs.single import run_trial
from dubins_traffic.synthesis.assumption import Assumption
from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.game import build
from dubins_traffic.synthesis.road_cells import RoadCells
from dubins_traffic.synthesis.road_play import UNKNOWN_MOVE, Ground
from dubins_traffic.synthesis.solver import solve
from dubins_traffic.synthesis.strategy import Strategy
from dubins_traffic.synthesis.synthesized import STRATEGY_LEFT, Synthesized
from tests.chain_reference import RING, SNAKE, Track

pytestmark = pytest.mark.path

BENT = {"random": {"intersections": 6, "segments": 7, "bent": 1.0, "rigid_motion": True}}
ALL = ("E1", "E2", "E3", "E4", "E5", "E6")


def test_the_game_does_not_change_where_roads_bend() -> None:
    straight, bent = (generate(7, 8, 2, bent=share, rigid_motion=True) for share in (1e-9, 1.0))
    assert bent.bent.sum() > 2
    assert straight.segments == bent.segments
    assert straight.is_straight
    found: list[Any] = []
    for network in (straight, bent):
        road_cells = RoadCells.of(network, (0, 3), 3)
        solution = solve(build(Board(road_cells, Assumption.parse(ALL), 1)))
        found.append((road_cells.nodes, Strategy.of(solution).board.others, solution.game.positions, solution))
    assert found[0][:3] == found[1][:3]
    assert all(
        np.array_equal(one.lost, other.lost) for one, other in zip(found[0][3].losses, found[1][3].losses, strict=True)
    )


@pytest.mark.parametrize("network", [RING, SNAKE], ids=["ring", "snake"])
def test_cells_know_how_far_along_a_bend_a_car_is_and_where_it_may_be(network: Any) -> None:
    road_cells = RoadCells.of(network, (0,), 3)
    ground, nodes = Ground(road_cells), len(road_cells.nodes)
    for lane in range(network.lanes):
        track = Track(network, lane >> 1)
        spots = [track.point(along) for along in np.linspace(1.3, track.length - 1.3, 9)]
        for (place, way), along in zip(spots, np.linspace(1.3, track.length - 1.3, 9), strict=True):
            pose = Pose(place.real, place.imag, way.real, way.imag)
            gone = track.length - along if lane & 1 else along
            assert ground.along(nodes + lane, pose) == pytest.approx(gone, abs=1e-6)
        x, y = network.points[network.ends[lane >> 1, 0]]
        far = max(abs(place - complex(x, y)) for place, _ in spots)
        assert not ground.within(nodes + lane, Pose(x, y, 1.0, 0.0), far - 1e-6, 0.0)


@pytest.mark.parametrize("number", [1, 3, 5])
def test_the_strategy_is_played_cleanly_on_roads_that_bend(number: int) -> None:
    own = instance(number, 120.0, network=BENT)
    assert not own.problem.network.is_straight
    events = Events()
    controller = Synthesized()
    score = run_trial(own, controller, sinks=[events]).score
    assert score.verdict is not None
    assert [one for one in score.verdict.violations if one.car == "ego"] == []
    kinds = Counter(kind for _, kind, _ in events.found)
    assert controller.play is not None
    assert controller.play.checked > 10
    assert kinds[UNKNOWN_MOVE] == kinds[STRATEGY_LEFT] == 0
    assert score.rounds >= 1


def _team(assumed: tuple[str, ...], seconds: float) -> Instance:
    """Return a trial with one `counter` on a ring that bends."""
    document = {
        "version": 1, "problem_domain": "dubins_traffic", "rnd": RING.to_document(),
        "e-agents": [{"type": "counter", "name": "car"}], "duration": seconds, "number_goals_bounds": [2, 2],
        "rules": {f"assume_e{k}": int(f"E{k}" in assumed) for k in range(1, 7)},
    }  # fmt: skip
    drawn = draw(load_config(document), 1, 0)
    return replace(drawn, problem=replace(drawn.problem, goals=((0, 0), (20, 10))))


def test_the_counterstrategy_keeps_the_ego_from_a_goal_on_roads_that_bend() -> None:
    assumed = ("E1", "E2", "E3", "E5", "E6")
    # Who stays in a disc for ever, which only E4 forbids, is on a journey that takes too long for E5, a little later.
    score = run_trial(_team(assumed, 170.0), "rules").score
    assert score.verdict is not None
    assert max(goal.longest_gap_s for goal in score.goals) >= 100.0
    assert [one for one in score.verdict.violations if one.car == "ego" or one.rule[:2] in assumed] == []
