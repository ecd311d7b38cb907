"""Rounds and ways that are found for many trials at once are those that are found for each by itself."""

from __future__ import annotations

import numpy as np

from dubins_traffic import draw, load_config
from dubins_traffic.learning.outlook import metres_to_vertices
from dubins_traffic.routing.rounds import find_all, round_time, stages
from dubins_traffic.routing.tours import EXACT, TOGETHER, LaneGraph, find_round, find_rounds, lane_graph


def test_many_rounds_are_those_found_one_by_one() -> None:
    network = draw(load_config("town"), seed=3, trial=0).problem.network
    count = len(network.intersections)
    draws = np.random.default_rng(5)
    lists = [tuple(draws.permutation(count)[: 1 + k % (EXACT + 2)].tolist()) for k in range(20)] + [
        (),
        (0, 1, 0),
    ]
    together, alone = LaneGraph(network), LaneGraph(network)
    find_rounds((together, goals) for goals in lists)
    assert set(together.rounds) == {tuple(dict.fromkeys(goals)) for goals in lists if goals}
    assert [find_round(together, goals) for goals in lists] == [find_round(alone, goals) for goals in lists]


def test_rounds_of_trials_on_many_networks_are_those_found_one_by_one() -> None:
    problems = [draw(load_config("town"), seed=3, trial=k).problem for k in range(TOGETHER + 3)]
    find_all([(problem.network, problem.goal_vertices) for problem in problems])
    for problem in problems:
        graph, alone = lane_graph(problem.network), LaneGraph(problem.network)
        known, found = dict(graph.rounds), find_round(alone, problem.goal_vertices)
        assert list(known.values()) == [found]
        assert found is not None
        assert round_time(problem.network, problem.goal_vertices, 0.5) == found.length / 0.5
        goals, metres = stages(problem.network, problem.goal_vertices)
        targets = [found.lanes[place] for place in found.arrivals]
        assert goals.tolist() == [alone.end[lane] for lane in targets]
        expected = np.array([alone.distances(lane) for lane in targets]) + np.array(alone.length)
        assert np.array_equal(metres, expected)
        assert graph.rounds == known


def test_ways_to_intersections_are_the_shortest_to_any_lane_into_them() -> None:
    network = draw(load_config("town"), seed=4, trial=0).problem.network
    graph = LaneGraph(network)
    lengths = np.array(graph.length)
    for v, way in enumerate(metres_to_vertices(network, range(len(network.intersections)))):
        expected = np.min([graph.distances(lane) for lane in graph.into[v]], axis=0) + lengths
        assert np.array_equal(way, expected)
