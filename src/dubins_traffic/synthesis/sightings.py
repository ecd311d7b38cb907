"""What is seen on the road, as cells of the game: where each car is, who is before whom, and who is not to be seen."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterable
from typing import Final, NamedTuple

from dubins_traffic.cars.state import Pose, Propositions
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.synthesis.arena import Arena

WAITS: Final = FLAG.STOPPED | FLAG.FIRST | FLAG.FORFEITED
"""The flags that say where in the order a car is."""
NOWHERE: Final = -1


class Sighting(NamedTuple):
    """A car in a frame, as its driver or another sees it; `car` is 0 for the ego."""

    car: int
    pose: Pose
    propositions: Propositions


class Ground:
    """The cells of an arena as places on the road.

    Parameters
    ----------
    arena : Arena
        The cells.
    """

    def __init__(self, arena: Arena) -> None:
        network = arena.network
        self.arena = arena
        self._nodes = [arena.nodes_of(v) for v in range(len(network.intersections))]
        self._points: list[list[float]] = network.points.tolist()
        self._network = network
        self._tangents = [
            (sign * tx, sign * ty)
            for begins, ends in zip(network.tangents.tolist(), network.end_tangents.tolist(), strict=True)
            for (tx, ty), sign in ((begins, 1.0), (ends, -1.0))
        ]
        self._ends = [network.lane_ends(lane) for lane in range(network.lanes)]
        self._hulls = [self._hull(segment) for segment in range(len(network.segments))]
        self._beside: list[list[int]] = [[] for _ in range(arena.cells)]
        for cell in range(arena.cells):
            for other in arena.following(cell):
                self._beside[other].append(cell)
                self._beside[cell].append(other)

    def cell(self, before: int, pose: Pose, seen: Propositions) -> int:
        """Return the cell of a car that was in the cell `before`, NOWHERE if that is not known.

        A car is in an intersection while its body meets the disc, else in the lane of its lane state.
        """
        count = len(self.arena.nodes)
        if seen.crosses < 0:
            return count + seen.lane if seen.lane >= 0 else before
        nodes = self._nodes[seen.crosses]
        if len(nodes) == 1 or before in nodes:
            return nodes[0] if len(nodes) == 1 else before
        if before >= count and self.arena.lane_end[before - count][0] in nodes:
            return self.arena.lane_end[before - count][0]
        return max(nodes, key=lambda node: self._fits(node, pose, seen))

    def _fits(self, node: int, pose: Pose, seen: Propositions) -> float:
        """Return how well a car that is first seen in a bend belongs into one of its nodes."""
        here = self.arena.nodes[node]
        if seen.lane >= 0 and (seen.lane in here.inbound or seen.lane in here.exits):
            return 2.0
        tx, ty = self._tangents[here.exits[0]]
        return tx * pose.c + ty * pose.s

    def along(self, cell: int, pose: Pose) -> float:
        """Return how far along its lane a car is, metres; 0 in intersections."""
        lane = cell - len(self.arena.nodes)
        if lane < 0:
            return 0.0
        x, y = self._points[self._ends[lane][0]]
        tx, ty = self._tangents[lane]
        if self._network.bent[lane >> 1]:
            return float(self._network.lane_coordinates(lane, (pose.x, pose.y))[0])
        return (pose.x - x) * tx + (pose.y - y) * ty

    def _hull(self, segment: int) -> list[list[float]]:
        """Return points whose convex hull holds a segment: its ends, and the corners between where it bends."""
        network = self.arena.network
        corners = [(x, y) for x, y, _ in network.corners[segment]] if network.corners else []
        ends = [self._points[v] for v in self._ends[2 * segment]]
        return [*ends, *network.to_world(corners).tolist()] if corners else ends

    def within(self, cell: int, pose: Pose, radius: float, margin: float) -> bool:
        """Say whether a car in a cell would be nearer to a pose than `radius`, wherever in the cell it is.

        Its centre is at most `margin` from the intersection, or in the lane between its ends.
        """
        count = len(self.arena.nodes)
        reach = radius - margin
        points = (
            [self._points[self.arena.nodes[cell].vertex]]
            if cell < count
            else self._hulls[(cell - count) >> 1]
        )
        return reach > 0.0 and all((x - pose.x) ** 2 + (y - pose.y) ** 2 < reach * reach for x, y in points)

    def nearest_free(self, cell: int, taken: Collection[int], avoided: Collection[int]) -> int:
        """Return the lane nearest to a cell that is not taken, nor to be avoided; if there is none, any free cell."""
        spare = [NOWHERE, NOWHERE]
        for near in self._by_distance(cell):
            if near in taken:
                continue
            if near >= len(self.arena.nodes) and near not in avoided:
                return near
            kind = 0 if near >= len(self.arena.nodes) else 1
            spare[kind] = near if spare[kind] == NOWHERE else spare[kind]
        return spare[0] if spare[0] != NOWHERE else spare[1]

    def _by_distance(self, cell: int) -> Iterable[int]:
        seen = {cell}
        waiting = deque([cell])
        while waiting:
            near = waiting.popleft()
            yield near
            for other in self._beside[near]:
                if other not in seen:
                    seen.add(other)
                    waiting.append(other)
