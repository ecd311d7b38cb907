"""Goals through which a car alone drives a round in a share of the trial (`goal_round_share`)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dubins_traffic as dt
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.maps.polylines import to_segments
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import Stream, draw, draw_many
from dubins_traffic.problem.goals import Reach, draw_goals
from dubins_traffic.problem.instance import Instance
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.routing.rounds import round_time
from dubins_traffic.runs.single import run_trial

MAPS = Path(__file__).parents[2] / "examples" / "maps"
ROAD = RoadNetwork.grid(1, 4)
"""Three segments of 3 m in a row, with two dead ends: a car turns round at these alone."""


def document(share: float | None = 0.4, **more: Any) -> dict[str, Any]:
    return {
        "version": 1, "problem_domain": "dubins_traffic", "network": {"grid": {"rows": 6, "columns": 6}},
        "duration": 60, "number_goals_bounds": [1, 4], "goal_round_share": share, "rules": True, **more,
    }  # fmt: skip


def seconds(instance: Instance) -> float:
    """Return the time of a free-flow round."""
    problem = instance.problem
    return round_time(problem.network, problem.goal_vertices, problem.car.bounds.speed)


def test_a_round_takes_at_most_that_share() -> None:
    drawn = [draw(load_config(document(share)), 5, trial) for share in (0.4, 0.7) for trial in range(30)]
    assert all(seconds(instance) <= 0.4 * 60 for instance in drawn[:30])
    assert all(seconds(instance) <= 0.7 * 60 for instance in drawn[30:])
    assert max(map(seconds, drawn[30:])) > 0.4 * 60
    assert {len(instance.problem.goals) for instance in drawn} == {1, 2, 3, 4}
    assert len({instance.problem.goals for instance in drawn}) > 40
    without = [draw(load_config(document(None)), 5, trial) for trial in range(30)]
    assert sum(seconds(instance) > 0.4 * 60 for instance in without) > 15


def test_the_ego_starts_on_its_round() -> None:
    """A round through its goals and both ends of the lane on which it stands is no longer than one may be."""
    roads = dt.generate_network(12, 15, 4)
    own = load_config(document(0.5, network=None, rnd=roads.to_document(), number_goals_bounds=[2, 2]))
    for trial in range(20):
        instance = draw(own, 1, trial)
        network, start = instance.problem.network, instance.starts[0]
        limit, speed = 0.5 * 60, instance.problem.car.bounds.speed
        point = np.array([[start.x, start.y]])
        off = [float(to_segments(point, np.array(network.lane_line(k, -0.3)))[0]) for k in range(network.lanes)]
        assert min(off) < 1e-6
        lane = int(np.argmin(off))
        with_end = {*instance.problem.goal_vertices, *network.lane_ends(lane)}
        assert round_time(network, sorted(with_end), speed) <= limit
    elsewhere = load_config({**own.to_document(), "ego": {"start": [1.0, -0.3, 0.0]}, "rnd": ROAD.to_document()})
    assert draw(elsewhere, 1, 0).starts[0].x == 1.0


def test_together_they_are_drawn_as_one_by_one() -> None:
    own = load_config(document(**{"e-agents": [{"type": "lawful", "name": "car", "count": 3}]}))
    one_by_one = [draw(own, 2, trial) for trial in range(12)]
    assert [(found.problem.goals, found.starts) for found in draw_many(own, 2, range(12))] == [
        (instance.problem.goals, instance.starts) for instance in one_by_one
    ]


def test_they_are_so_many_segments_apart_too() -> None:
    own = load_config(document(0.7, goal_segments_apart=2, number_goals_bounds=[2, 3]))
    for trial in range(20):
        instance = draw(own, 3, trial)
        network, (first, *others) = instance.problem.network, instance.problem.goal_vertices
        beside = {network.lane_ends(lane)[1] for lane in network.arms(first)}
        assert not beside & set(others)
        assert seconds(instance) <= 0.7 * 60


def test_where_the_number_drawn_is_too_large_there_are_fewer_down_to_the_lower_bound() -> None:
    """To the next intersection and back are 6 m; from end to end and back, the only round through two, 18 m."""
    for seed in range(20):
        draws = Draws(seed, 0, Stream.GOALS)
        assert len(draw_goals(ROAD, (1, 3), draws, 1, Reach(0.5, 17.9)).vertices) == 1
    numbers = [
        len(draw_goals(ROAD, (1, 3), Draws(seed, 0, Stream.GOALS), 1, Reach(0.5, 18.0)).vertices) for seed in range(40)
    ]
    assert set(numbers) == {1, 2, 3}
    with pytest.raises(
        InputError, match=r"goal_round_share.*no round through 2 goals is as short as 17\.9 m.*got 0\.5"
    ):
        draw_goals(ROAD, (2, 3), Draws(0, 0, Stream.GOALS), 1, Reach(0.5, 17.9))
    with pytest.raises(InputError, match=r"goal_round_share.*no round through 1 goals is as short as 5\.9 m"):
        draw_goals(ROAD, (1, 3), Draws(0, 0, Stream.GOALS), 1, Reach(0.5, 5.9))
    assert draw_goals(ROAD, (0, 3), Draws(0, 0, Stream.GOALS), 1, Reach(0.5, 5.9)).vertices == ()


def test_a_large_network_takes_no_longer_than_its_steps() -> None:
    large = RoadNetwork.grid(60, 60)
    with pytest.raises(InputError, match="goal_round_share"):
        draw_goals(large, (4, 4), Draws(0, 0, Stream.GOALS), 1, Reach(0.01, 11.0))
    assert len(draw_goals(large, (4, 4), Draws(0, 0, Stream.GOALS), 1, Reach(0.01, 12.0)).vertices) == 4


@pytest.mark.parametrize("value", [0, -0.5, 1.5, "half", True])
def test_other_values_are_refused(value: object) -> None:
    with pytest.raises(InputError, match="goal_round_share"):
        load_config({**document(), "goal_round_share": value})


@pytest.mark.parametrize("file", sorted(path.name for path in MAPS.iterdir() if path.suffix != ".md"))
def test_rules_makes_counted_rounds_on_every_map_that_is_shipped(file: str) -> None:
    own = load_config(
        document(
            network=None,
            rnd=str(MAPS / file),
            duration=300,
            **{"e-agents": [{"type": "lawful", "name": "car"}]},
        )
    )
    for trial in range(3):
        assert run_trial(draw(own, 1, trial), "rules").score.counted_rounds >= 1
