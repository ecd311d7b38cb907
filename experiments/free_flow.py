"""Free flow: times and distances of rounds on empty roads, for comparison.

A point that meets nobody drives, at the car's top speed, along lanes: from the ego's start, on the lane that its
heading tells, to the nearest goal on the round, and then the round for ever. The round is the shortest closed route
through all goals (`routing.tours.find_round`); every lane counts the full length of its segment, turning costs nothing,
and it turns round at dead ends only. The round of a single goal goes to the nearest other intersection and back, since
that makes a visit.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING

import numpy as np

from dubins_traffic.cars.state import Pose
from dubins_traffic.routing.tours import LaneGraph, find_round, free_round, lane_graph

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance, Problem


@dataclass(frozen=True, slots=True)
class FreeFlow:
    """Free flow of one instance.

    Attributes
    ----------
    speed : float
        The car's top speed, m/s.
    round_length : float
        Metres of a round; inf without goals or if no round reaches them all.
    arrivals : tuple of (float, int)
        Metres driven from the start to the intersection of each goal passed, and that goal's vertex, until the round
        is closed for the first time.
    """

    speed: float
    round_length: float
    arrivals: tuple[tuple[float, int], ...]

    @property
    def round_time(self) -> float:
        """Seconds of a round."""
        return self.round_length / self.speed

    def distance(self, duration: float) -> float:
        """Return the metres driven in `duration` seconds."""
        return self.speed * duration

    def rounds(self, duration: float) -> int:
        """Return the rounds completed in `duration` seconds: one when every goal has been passed for the first time,
        and one for every round's length driven after that.
        """
        if not self.arrivals:
            return 0
        first = {goal: far for far, goal in reversed(self.arrivals)}
        beyond = self.distance(duration) - max(first.values())
        return 0 if beyond < 0.0 else 1 + int(beyond / self.round_length)


def free_flow(instance: Instance, *, turns: bool = True) -> FreeFlow:
    """Return the free flow of an instance.

    Without `turns` it turns round at dead ends only for a single goal too, as some drivers do: the round is then the
    shortest closed route through it.
    """
    problem = instance.problem
    graph = lane_graph(problem.network)
    tour = (free_round if turns else find_round)(graph, problem.goal_vertices)
    speed = problem.car.bounds.speed
    if tour is None:
        return FreeFlow(speed, inf, ())
    goals = set(problem.goal_vertices)
    lane, to_go = _start_lane(problem, instance.starts[0], graph)
    best, place = inf, 0
    if turns and len(goals) == 1:
        best, place = min(graph.distances(into)[lane] for into in graph.into[min(goals)]), tour.arrivals[0]
    else:
        for k in dict.fromkeys(tour.arrivals[:8]):
            far = graph.distances(tour.lanes[k])[lane]
            if far < best:
                best, place = far, k
    far = to_go + best
    arrivals = [(far, graph.end[tour.lanes[place]])]
    for k in range(1, len(tour.lanes)):
        following = tour.lanes[(place + k) % len(tour.lanes)]
        far += graph.length[following]
        if graph.end[following] in goals:
            arrivals.append((far, graph.end[following]))
    return FreeFlow(speed, tour.length, tuple(arrivals))


def _start_lane(problem: Problem, pose: Pose, graph: LaneGraph) -> tuple[int, float]:
    """Return the lane on which a car at `pose` is, by its heading, and the metres from there to the lane's end."""
    network = problem.network
    point = np.array((pose.x, pose.y))
    segment = int(network.nearest_segment(point)[0])
    along, _ = network.lane_coordinates(2 * segment, point)
    tx, ty = network.lane_places(2 * segment, along.reshape(1))[1][0].tolist()
    lane = 2 * segment + (0 if pose.c * tx + pose.s * ty >= 0.0 else 1)
    along = float(network.lane_coordinates(lane, point)[0])
    return lane, graph.length[lane] - min(max(along, 0.0), graph.length[lane])
