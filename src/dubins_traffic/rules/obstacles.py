"""The static obstacles of each trial in the coordinates of the segments on which they lie."""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from dubins_traffic.cars.tables import ObstacleTable, Part
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.records import Rows, record, table
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.roads.table import RoadTable, Segment


@record
class ObstaclePart:
    """A part of an obstacle beside a segment: the line between two ends, grown by a rounding; metres."""

    s0: float
    l0: float
    s1: float
    l1: float
    """Metres along the segment, in its first direction, and to the left of its centre line, of the two ends."""
    rounding: float
    owner: int
    """Number of the obstacle."""


class ObstacleLanes(Tables):
    """Parts of obstacles by segment.

    Attributes
    ----------
    base : (B,) int64
        Where the segments of trial b begin in `start`; -1 for a trial without obstacles.
    start : int64
        Parts of segment s of trial b are those from start[base[b] + s] to start[base[b] + s + 1] - 1.
    part : (P,) ObstaclePart
        Parts of one obstacle follow each other.
    """

    base: Ints
    start: Ints
    part: Rows[ObstaclePart]


def place_obstacles(obstacles: ObstacleTable, roads: RoadTable, nets: Ints) -> ObstacleLanes:
    """Return the parts of obstacles beside each segment, of those obstacles that reach 2w of its centre line.

    `nets` (B,) are the numbers of the trials' road networks.
    """
    if not len(obstacles.parts):
        none = np.full(len(nets), -1, dtype=np.int64)
        return ObstacleLanes(none, np.zeros(1, np.int64), table(ObstaclePart, 0))
    base: list[int] = []
    start: list[int] = [0]
    parts: list[Any] = []
    for b, net in enumerate(nets):
        own = slice(int(obstacles.off[b]), int(obstacles.off[b + 1]))
        if own.start == own.stop:
            base.append(-1)
            continue
        base.append(len(start) - 1)
        for row in range(int(roads.seg_off[net]), int(roads.seg_off[net + 1])):
            part, reaches = _on_segment(
                obstacles.parts[own], roads.segment[row], float(roads.half_width[net])
            )
            parts.append(part[reaches])
            start.append(start[-1] + int(reaches.sum()))
    rows = table(ObstaclePart, start[-1])
    cast(Any, rows)[:] = np.concatenate(parts)
    return ObstacleLanes(np.array(base, dtype=np.int64), np.array(start, dtype=np.int64), rows)


def _on_segment(parts: Rows[Part], segment: Segment, half_width: float) -> tuple[Any, Any]:
    """Return the parts (P,) in the coordinates of a segment, and which of them are beside it."""
    owner, rounding = parts["owner"], parts["rounding"]
    rows: Any = table(ObstaclePart, len(parts))
    for along, left, sign in (("s0", "l0", -1.0), ("s1", "l1", 1.0)):
        px = parts["x"] + sign * parts["half_length"] * parts["c"] - segment.x
        py = parts["y"] + sign * parts["half_length"] * parts["s"] - segment.y
        rows[along] = px * segment.tx + py * segment.ty
        rows[left] = py * segment.tx - px * segment.ty
    rows["rounding"] = rounding
    rows["owner"] = owner
    ends = np.stack([rows["s0"], rows["s1"]]), np.stack([rows["l0"], rows["l1"]])
    begin, end = ends[0].min(axis=0) - rounding, ends[0].max(axis=0) + rounding
    right, left = ends[1].min(axis=0) - rounding, ends[1].max(axis=0) + rounding
    reaches = (end >= 0.0) & (begin <= segment.length)
    for number in np.unique(owner[reaches]):
        own = reaches & (owner == number)
        if left[own].max() <= -half_width or right[own].min() >= half_width:
            reaches[own] = False
    return rows, reaches
