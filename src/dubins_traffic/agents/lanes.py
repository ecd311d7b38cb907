"""Which lane an e-agent takes next."""

from __future__ import annotations

from dubins_traffic.agents.tables import Team
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.random import DRAW, below
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.routing.lane_graph import FAR


@jit
def random_exit(roads: RoadTable, v: int, lane: int, team: Team, car: int, tick: int) -> int:
    """Return a random lane out of `v`, each equally likely, except the one back, which is taken at dead ends only.

    The draw follows from the team's seed, `car` (number) and tick.
    """
    arms, degree = roads.arms, roads.degree
    if degree[v] < 2:
        return lane ^ 1
    pick = below(team.seed, team.trial, car, tick, DRAW.LANE, degree[v] - 1)
    for k in range(degree[v]):
        if arms[v, k] != lane ^ 1:
            if pick == 0:
                return arms[v, k]
            pick -= 1
    return lane ^ 1


@jit
def nearer_exit(roads: RoadTable, v: int, lane: int, hops: Ints) -> int:
    """Return the lane out of `v` with the fewest hops to go; the lane back only if no other leads there.

    `hops` (L,) is the number of lanes to go from each lane.
    """
    arms, degree = roads.arms, roads.degree
    best = lane ^ 1
    fewest = FAR
    for k in range(degree[v]):
        if arms[v, k] != lane ^ 1 and hops[arms[v, k]] < fewest:
            best = arms[v, k]
            fewest = hops[best]
    return best
