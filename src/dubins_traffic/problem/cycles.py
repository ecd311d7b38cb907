"""Cycles of segments, for e-agents that drive round one."""

from __future__ import annotations

from collections.abc import Sequence

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.roads.network import RoadNetwork


def draw_cycle(network: RoadNetwork, draws: Draws) -> list[list[float]]:
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


def cycle_lanes(network: RoadNetwork, points: Sequence[Sequence[float]]) -> tuple[int, ...]:
    """Return the lanes of a cycle of lattice points, the last joined to the first (which may stand again at the end).

    Raises
    ------
    InputError
        If a point is no intersection or two that follow one another are not joined by a segment.
    """
    if len(points) > 1 and list(points[0]) == list(points[-1]):
        points = points[:-1]
    lanes: list[int] = []
    for k, point in enumerate(points):
        following = points[(k + 1) % len(points)]
        try:
            start = network.vertex((point[0], point[1]))
            end = network.vertex((following[0], following[1]))
        except InputError as error:
            raise error.within(field=f"cycle[{k}]") from None
        lane = next((lane for lane in network.arms(start) if network.lane_ends(lane)[1] == end), None)
        if lane is None:
            expected = "points that follow one another along segments, the last joined to the first"
            raise InputError(
                "no segment to the next point", field=f"cycle[{k}]", value=point, expected=expected
            )
        lanes.append(lane)
    return tuple(lanes)
