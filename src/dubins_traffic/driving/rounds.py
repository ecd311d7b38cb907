"""The round that a car drives under the rules: its goals in order, and how far it is to each from every lane."""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING

import numpy as np

from dubins_traffic.driving.tours import find_round, lane_graph
from dubins_traffic.kernels.arrays import Floats, Ints

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Problem


def stages(problem: Problem) -> tuple[Ints, Floats]:
    """Return the goals in the order of the round (M,), and the metres from the start of each lane to each (M, L).

    M is 0 without goals that can be reached.
    """
    graph = lane_graph(problem.network)
    goals = tuple(dict.fromkeys(problem.goal_vertices))
    found = find_round(graph, goals) if goals else None
    if found is None:
        return np.zeros(0, dtype=np.int64), np.zeros((0, 0))
    rows: list[list[float]] = []
    stage: list[int] = []
    for place in found.arrivals:
        target = found.lanes[place]
        to_target = graph.distances(target)
        rows.append(
            [far + own if far < inf else inf for far, own in zip(to_target, graph.length, strict=True)]
        )
        stage.append(graph.end[target])
    return np.array(stage, dtype=np.int64), np.array(rows)


def nearest_stage(distance: Floats, lane: int, segment: int) -> int:
    """Return the goal that is nearest along lanes from `lane`, or from `segment` for a car without lane state."""
    return int(np.argmin(distance[:, lane if lane >= 0 else 2 * segment]))
