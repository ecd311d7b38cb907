"""The round that a car drives under the rules: its goals in order, and the distance to each from every lane."""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING

import numpy as np

from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.routing.tours import find_round, find_rounds, free_round, lane_graph

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from dubins_traffic.roads.network import RoadNetwork


def find_all(wanted: Iterable[tuple[RoadNetwork, Sequence[int]]]) -> None:
    """Find many rounds, in less time than `round_time` and `stages` take one after another."""
    find_rounds((lane_graph(network), goals) for network, goals in wanted)


def round_time(network: RoadNetwork, goals: Sequence[int], speed: float) -> float:
    """Return the seconds of a round through all goals in free flow: at `speed` (m/s) on empty roads; inf: none exists.

    The round is the shortest closed route through all goals, which turns round at dead ends only; that of a single goal
    goes to the nearest other intersection and back, since that makes a visit. Turning costs nothing.
    """
    tour = free_round(lane_graph(network), goals)
    return inf if tour is None else tour.length / speed


def stages(network: RoadNetwork, goals: Sequence[int]) -> tuple[Ints, Floats]:
    """Return the goals in the order of the round (M,), and the metres from the start of each lane to each (M, L).

    M is 0 without goals that can be reached.
    """
    graph = lane_graph(network)
    tour = find_round(graph, goals)
    if tour is None:
        return np.zeros(0, dtype=np.int64), np.zeros((0, 0))
    kept = graph.stages.get(tour)
    if kept is None:
        targets = [tour.lanes[place] for place in tour.arrivals]
        distance = np.stack([graph.distances(target) for target in targets]) + np.array(graph.length)
        kept = np.array([graph.end[target] for target in targets], dtype=np.int64), distance
        graph.stages[tour] = kept
    return kept
