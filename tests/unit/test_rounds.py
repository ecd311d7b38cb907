"""Rounds and ways that are found for many trials at once are those that are found for each by itself."""

from __future__ import annotations

import numpy as np

from dubins_traffic import draw, load_config
from dubins_traffic.learning.outlook import metres_to_vertices
from dubins_traffic.routing.rounds import find_all, round_time
from dubins_traffic.routing.tours import EXACT, LaneGraph, find_round, find_rounds, lane_graph


def test_many_rounds_are_those_found_one_by_one() -> None:
    network = draw(load_config("town"), seed=3, trial=0).problem.network
    count = len(network.intersections)
    draws = np.random.default_rng(5)
    lists = [tuple(draws.permutation(count)[: 1 + k % (EXACT + 2)].tolist()) for k in range(20)] + [
        (),
        (0, 1, 0),
    ]
    together, alone = LaneGraph(network), LaneGraph(network)
    find_rounds(together, lists)
    assert set(together.rounds) == {tuple(dict.fromkeys(goals)) for goals in lists if goals}
    assert [find_round(together, goals) for goals in lists] == [find_round(alone, goals) for goals in lists]


def test_rounds_of_trials_are_known_once_all_are_found() -> None:
    problems = [draw(load_config("town"), seed=3, trial=k).problem for k in range(4)]
    find_all([(problem.network, problem.goal_vertices) for problem in problems])
    for problem in problems:
        known = dict(lane_graph(problem.network).rounds)
        assert len(known) == 1
        assert round_time(problem.network, problem.goal_vertices, 0.5) > 0.0
        assert lane_graph(problem.network).rounds == known


def test_ways_to_intersections_are_the_shortest_to_any_lane_into_them() -> None:
    network = draw(load_config("town"), seed=4, trial=0).problem.network
    graph = LaneGraph(network)
    lengths = np.array(graph.length)
    for v, way in enumerate(metres_to_vertices(network, range(len(network.intersections)))):
        expected = np.min([graph.distances(lane) for lane in graph.into[v]], axis=0) + lengths
        assert np.array_equal(way, expected)
