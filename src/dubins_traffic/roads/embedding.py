"""Where the segments and intersections of a network lie in the world."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from dubins_traffic.kernels.angles import sincos
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.roads.chains import Chains, Runs, turned
from dubins_traffic.roads.formats.rnd import Corners, Segment

Point = tuple[float, float]
Line = tuple[Point, Point]


class Embedding:
    """The geometry of `roads.network.RoadNetwork`, which has the data. Arrays can't be written to."""

    segments: tuple[Segment, ...]
    length: float
    transform: tuple[float, float, float]
    corners: tuple[Corners, ...]

    @property
    def is_straight(self) -> bool:
        """Whether no segment bends."""
        return not self.corners

    @cached_property
    def chains(self) -> Chains:
        """The pieces of the segments that bend."""
        return Chains(self.segments, self.corners, self.length, self.transform)

    @cached_property
    def intersections(self) -> tuple[Point, ...]:
        """Points of the lattice's frame where roads end, sorted by x, then y."""
        points = {(x0, y0) for x0, y0, _, _ in self.segments} | {(x1, y1) for _, _, x1, y1 in self.segments}
        return tuple(sorted(points))

    @cached_property
    def _numbers(self) -> dict[Point, int]:
        return {point: v for v, point in enumerate(self.intersections)}

    @cached_property
    def points(self) -> Floats:
        """World coordinates of the intersections, (V, 2), metres."""
        return _fixed(self.to_world(np.array(self.intersections, dtype=np.float64)))

    @cached_property
    def ends(self) -> Ints:
        """Numbers of the intersections at both ends of each segment, (S, 2)."""
        rows = [(self._numbers[x0, y0], self._numbers[x1, y1]) for x0, y0, x1, y1 in self.segments]
        ends = np.array(rows, dtype=np.int64)
        ends.flags.writeable = False
        return ends

    @cached_property
    def _steps(self) -> Floats:
        """Lattice vectors from the first to the second end of each segment, (S, 2)."""
        segment = np.array(self.segments, dtype=np.float64)
        return segment[:, 2:] - segment[:, :2]

    @cached_property
    def lengths(self) -> Floats:
        """Lengths of the segments, (S,), metres; a rigid motion does not change a bit of them."""
        dx, dy = self._steps.T
        straight = self.length * np.sqrt(dx * dx + dy * dy)
        return _fixed(straight if self.is_straight else np.where(self.bent, self.chains.lengths, straight))

    @cached_property
    def bent(self) -> npt.NDArray[np.bool_]:
        """Whether each segment bends, (S,)."""
        return _fixed(np.array([bool(own) for own in self.corners] or [False] * len(self.segments)))

    @cached_property
    def tangents(self) -> Floats:
        """Unit vectors along the segments at their first ends, (S, 2)."""
        found = self._directions
        if not self.is_straight:
            found[self.bent] = self.chains.tangent[self.chains.first[:-1][self.bent]]
        return _fixed(found)

    @cached_property
    def end_tangents(self) -> Floats:
        """Unit vectors along the segments at their second ends, (S, 2): equal to `tangents` unless they bend."""
        if self.is_straight:
            return self.tangents
        found = self._directions
        found[self.bent] = self.chains.end_tangent[self.chains.first[1:][self.bent] - 1]
        return _fixed(found)

    @property
    def _directions(self) -> Floats:
        """Unit vectors from the first to the second end of each segment, (S, 2)."""
        dx, dy = self._steps.T
        norm = np.sqrt(dx * dx + dy * dy)
        return turned(np.stack([dx / norm, dy / norm], axis=-1), *sincos(self.transform[2]))

    @cached_property
    def runs(self) -> Runs:
        """The longest straight run of each segment."""
        straight = Runs(
            self.points[self.ends[:, 0]], self.points[self.ends[:, 1]], self.tangents, self.lengths
        )
        return straight if self.is_straight else self.chains.runs(straight)

    @cached_property
    def degrees(self) -> Ints:
        """Number of roads at each intersection, (V,)."""
        degrees = np.bincount(self.ends.ravel(), minlength=len(self.intersections)).astype(np.int64)
        degrees.flags.writeable = False
        return degrees

    def lane_ends(self, lane: int) -> tuple[int, int]:
        """Return the intersections in which a lane begins and ends."""
        first, second = self.ends[lane >> 1].tolist()
        return (second, first) if lane & 1 else (first, second)

    def to_world(self, points: npt.ArrayLike) -> Floats:
        """Map lattice points (..., 2) to the world."""
        tx, ty, theta = self.transform
        return turned(self.length * np.asarray(points, dtype=np.float64), *sincos(theta)) + np.array([tx, ty])

    def to_lattice(self, points: npt.ArrayLike) -> Floats:
        """Map world points (..., 2) to the lattice, where they need not be whole."""
        tx, ty, theta = self.transform
        c, s = sincos(theta)
        return turned(np.asarray(points, dtype=np.float64) - np.array([tx, ty]), c, -s) / self.length

    def lane_places(self, lane: int, along: Floats) -> tuple[Floats, Floats]:
        """Return points (N, 2) so many metres along the middle of a lane's road, and unit vectors (N, 2) along it."""
        s, back = lane >> 1, bool(lane & 1)
        if self.bent[s]:
            point, way = self.chains.places(s, self.lengths[s] - along if back else along)
            return point, -way if back else way
        way = -self.tangents[s] if back else self.tangents[s]
        start = self.points[self.ends[s, 1 if back else 0]]
        return start + along[:, None] * way, np.broadcast_to(way, (len(along), 2))

    def lane_line(self, lane: int, offset: float) -> Line:
        """Return the ends of the line parallel to a lane, `offset` m left of the centre line (the right lane: -w)."""
        first, last = self.lane_curve(lane, offset)[[0, -1]].tolist()
        return (first[0], first[1]), (last[0], last[1])

    def lane_curve(self, lane: int, offset: float, sagitta: float = 0.01) -> Floats:
        """Return the corners (K, 2) of a line parallel to a lane, `offset` metres left of the centre line.

        On arcs it leaves the parallel by about `sagitta` metres at most; that of a straight lane has its two ends.
        """
        s = lane >> 1
        left = -offset if lane & 1 else offset
        if self.bent[s]:
            line, way = self.chains.places(s, self.chains.marks(s, sagitta))
        else:
            line, way = self.points[self.ends[s]], self.tangents[[s, s]]
        drawn = np.stack([line[:, 0] - left * way[:, 1], line[:, 1] + left * way[:, 0]], axis=-1)
        return drawn[::-1] if lane & 1 else drawn


def _fixed(array: npt.NDArray[Any]) -> Any:
    array.flags.writeable = False
    return array
