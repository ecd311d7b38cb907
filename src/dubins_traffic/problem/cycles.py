"""Cycles of segments, for e-agents that drive round one."""

from __future__ import annotations

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.problem.instance import EAgent
from dubins_traffic.roads.network import RoadNetwork


def draw_cycle(network: RoadNetwork, draws: Draws) -> list[list[int]]:
    """Return the lattice points of a random cycle along lanes; it turns round at dead ends only.

    A random walk along lanes is cut where it comes back to an intersection from which it may go on as it did.
    """
    walk = [draws.below(network.lanes)]
    while True:
        following = network.successors(walk[-1])
        start = network.lane_ends(walk[-1])[1]
        for k, lane in enumerate(walk):
            if network.lane_ends(lane)[0] == start and lane in following:
                return [list(network.intersections[network.lane_ends(own)[0]]) for own in walk[k:]]
        walk.append(following[draws.below(len(following))])


def cycle_lanes(network: RoadNetwork, agent: EAgent) -> tuple[int, ...]:
    """Return the lanes of a loop's cycle, in order.

    Raises
    ------
    InputError
        If a point is no intersection or two that follow one another are not joined by a segment.
    """
    points = agent.parameters["cycle"]
    lanes: list[int] = []
    for k, point in enumerate(points):
        field = f"cycle[{k}] of {agent.name}"
        try:
            start = network.vertex(tuple(point))
            end = network.vertex(tuple(points[(k + 1) % len(points)]))
        except InputError as error:
            raise error.within(field=field) from None
        lane = next((lane for lane in network.arms(start) if network.lane_ends(lane)[1] == end), None)
        if lane is None:
            expected = "points that follow one another along segments, the last joined to the first"
            raise InputError("no segment to the next point", field=field, value=point, expected=expected)
        lanes.append(lane)
    return tuple(lanes)
