"""Goals that are drawn a number of segments apart."""

from __future__ import annotations

from itertools import combinations

import pytest

import dubins_traffic as dt
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import Stream, draw, draw_many
from dubins_traffic.problem.goals import draw_goals
from dubins_traffic.roads.network import RoadNetwork
from tests.shuttle import NAME, counted, document

GRID = RoadNetwork.grid(3, 4)


def segments_between(roads: RoadNetwork, one: tuple[float, float], other: tuple[float, float]) -> int:
    """Return how many segments the shortest way along the roads has."""
    beside = {frozenset(((x0, y0), (x1, y1))) for x0, y0, x1, y1 in roads.segments}
    reached, steps = {one}, 0
    while other not in reached:
        reached |= {b for pair in beside for a in pair if a in reached for b in pair}
        steps += 1
    return steps


def goals(roads: RoadNetwork, count: int, apart: int, seed: int = 0) -> tuple[tuple[float, float], ...]:
    picks = draw_goals(roads, (count, count), Draws(seed, 0, Stream.GOALS), apart).vertices
    return tuple(roads.intersections[v] for v in picks)


@pytest.mark.parametrize("apart", [2, 3])
def test_every_two_goals_are_so_far_apart(apart: int) -> None:
    for seed in range(40):
        roads = GRID if seed % 2 else dt.generate_network(12, 15, seed)
        found = goals(roads, 4 if apart == 2 else 2, apart, seed)
        assert len(set(found)) == len(found)
        assert all(segments_between(roads, *pair) >= apart for pair in combinations(found, 2))


def test_each_intersection_is_first_and_second_as_often_as_another() -> None:
    drawn = [goals(GRID, 2, 2, seed) for seed in range(3000)]
    counts = [sum(found[0] == point for found in drawn) for point in GRID.intersections]
    assert min(counts) > 200
    assert max(counts) < 300
    second = [found[1] for found in drawn if found[0] == (0, 0)]
    assert set(second) == set(GRID.intersections) - {(0, 0), (1, 0), (0, 1)}


def test_without_the_option_goals_are_drawn_as_ever() -> None:
    document = {key: value for key, value in load_config("town").to_document().items() if key != "goal_segments_apart"}
    bare, said = load_config(document), load_config({**document, "goal_segments_apart": 1})
    for trial in range(6):
        draws = Draws(3, trial, Stream.GOALS)
        count = draws.between(2, 4)
        expected = [draw(bare, 3, trial).problem.network.intersections[v] for v in draws.sample(count, 12)]
        assert draw(bare, 3, trial).problem.goals == draw(said, 3, trial).problem.goals == tuple(expected)


def test_together_they_are_drawn_as_one_by_one() -> None:
    own = load_config({**load_config("junction").to_document(), "goal_segments_apart": 2})
    assert [found.problem.goals for found in draw_many(own, 1, range(8))] == [
        draw(own, 1, trial).problem.goals for trial in range(8)
    ]


def test_as_many_as_there_can_be_are_found_and_no_more() -> None:
    for seed in range(20):
        assert len(goals(GRID, 6, 2, seed)) == 6
        with pytest.raises(InputError, match=r"goal_segments_apart.*7 goals so far apart.*got 2"):
            goals(GRID, 7, 2, seed)
    with pytest.raises(InputError, match="number_goals_bounds"):
        goals(RoadNetwork.grid(30, 30), 460, 2)


@pytest.mark.parametrize("value", [0, -1, 1.5, "two", True])
def test_other_values_are_refused(value: object) -> None:
    with pytest.raises(InputError, match="goal_segments_apart"):
        load_config({**load_config("town").to_document(), "goal_segments_apart": value})


def test_an_impossible_one_is_refused_by_name() -> None:
    document = {**load_config("junction").to_document(), "goal_segments_apart": 3}
    with pytest.raises(InputError, match=r"goal_segments_apart.*2 goals so far apart are not found.*fewer goals"):
        draw(load_config(document))


def test_shuttling_gains_little_between_three_goals_apart() -> None:
    """`python -m tests.shuttle 6`: 1.08 times the rounds of `rules`; between two goals anywhere 1.5 times."""
    own = document(3, 3, 3, 2) | {"duration": 120}
    shuttling, rules = counted(own, NAME, 2), counted(own, "rules", 2)
    assert 0 < shuttling <= 1.25 * rules
