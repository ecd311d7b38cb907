"""Lanes in order around intersections, and shortest routes along them.

Lane 2s runs along segment s from its first to its second end, lane 2s + 1 back.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cmp_to_key
from math import inf

import numpy as np

from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.roads.formats.rnd import Segment


@dataclass(frozen=True, slots=True)
class Routes:
    """Shortest routes to one intersection.

    Attributes
    ----------
    next_lane : array (L,) of int64
        The lane to take at the end of each lane; -1 where the lane ends in the intersection.
    distance : array (L,) of float64
        Metres from the start of each lane to the intersection; inf where no route leads there.
    """

    next_lane: Ints
    distance: Floats

    def follow(self, lane: int) -> list[int]:
        """Return the lanes from `lane` to the intersection, both included; empty if no route leads there."""
        if not self.distance[lane] < inf:
            return []
        path = [lane]
        while self.next_lane[path[-1]] >= 0:
            path.append(int(self.next_lane[path[-1]]))
        return path


def arms(sides: Sequence[Segment], ends: Ints, count: int) -> list[tuple[int, ...]]:
    """Return the lanes out of each of `count` intersections, counter-clockwise by bearing from the lattice's x axis.

    `sides` are the vectors (dx, dy, dx, dy) along each segment where it begins and where it ends.
    """
    out: list[list[tuple[float, float, int]]] = [[] for _ in range(count)]
    for s, (ax, ay, bx, by) in enumerate(sides):
        out[int(ends[s, 0])].append((ax, ay, 2 * s))
        out[int(ends[s, 1])].append((-bx, -by, 2 * s + 1))
    return [tuple(lane for _, _, lane in sorted(own, key=cmp_to_key(_turn))) for own in out]


def _turn(p: tuple[float, float, int], q: tuple[float, float, int]) -> int:
    """Compare two directions by bearing in [0, 2 pi), exactly on the lattice."""
    lower_p = p[1] < 0 or (p[1] == 0 and p[0] < 0)
    lower_q = q[1] < 0 or (q[1] == 0 and q[0] < 0)
    if lower_p != lower_q:
        return 1 if lower_p else -1
    cross = p[0] * q[1] - p[1] * q[0]
    return -1 if cross > 0 else 1


def shortest(
    target: int, lane_end: Sequence[int], lengths: Sequence[float], before: Sequence[Sequence[int]]
) -> Routes:
    """Return the shortest routes to the intersection `target` (Dijkstra, backwards over lanes).

    Parameters
    ----------
    target : int
        Number of the intersection.
    lane_end, lengths : sequences (L,)
        Intersection in which each lane ends, and its metres.
    before : sequence (L,) of sequences
        The lanes that may be left for each lane. Of equally short routes the lane of lowest number is taken.
    """
    count = len(lane_end)
    distance = [inf] * count
    follow = [-1] * count
    heap: list[tuple[float, int]] = []
    for lane in range(count):
        if lane_end[lane] == target:
            distance[lane] = lengths[lane]
            heap.append((lengths[lane], lane))
    heapq.heapify(heap)
    while heap:
        gone, lane = heapq.heappop(heap)
        if gone > distance[lane]:
            continue
        for previous in before[lane]:
            length = gone + lengths[previous]
            closer = length < distance[previous]
            if closer or (length == distance[previous] and lane < follow[previous]):
                follow[previous] = lane
            if closer:
                distance[previous] = length
                heapq.heappush(heap, (length, previous))
    return Routes(np.array(follow, dtype=np.int64), np.array(distance, dtype=np.float64))
