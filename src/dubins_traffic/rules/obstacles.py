"""The static obstacles of each trial in the coordinates of the segments on which they lie."""

from __future__ import annotations

from itertools import pairwise
from math import ceil
from typing import Any, cast

import numpy as np

from dubins_traffic.cars.tables import ObstacleTable, Part
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.records import Rows, record, table
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.roads.lookup import bent_coordinates, bent_distance2
from dubins_traffic.roads.table import RoadTable, Segment

STEP = 0.05
"""An edge beside a segment that bends is replaced by points at most this far apart, metres."""
LEAP = 0.5
"""Two consecutive points of an edge whose coordinates along a bent segment differ by more are not joined, metres."""


@record
class ObstaclePart:
    """A part of an obstacle in the coordinates of a segment: the line between two ends, grown by a rounding; metres."""

    s0: float
    l0: float
    s1: float
    l1: float
    """Metres along the segment, in its first direction, and to the left of its centre line, of the two ends."""
    rounding: float
    owner: int
    """Number of the obstacle."""


class ObstacleLanes(Tables):
    """The parts of obstacles beside each segment.

    Attributes
    ----------
    base : (B,) int64
        Index in `start` of the first segment of trial b; -1 for a trial without obstacles.
    start : int64
        Parts of segment s of trial b are those from start[base[b] + s] to start[base[b] + s + 1] - 1.
    part : (P,) ObstaclePart
        Parts of one obstacle follow each other.
    """

    base: Ints
    start: Ints
    part: Rows[ObstaclePart]


def place_obstacles(obstacles: ObstacleTable, roads: RoadTable, nets: Ints) -> ObstacleLanes:
    """Return, for each segment, the parts of all obstacles that come within 2w of its centre line.

    `nets` (B,) are the numbers of the trials' road networks.
    """
    if not len(obstacles.parts):
        none = np.full(len(nets), -1, dtype=np.int64)
        return ObstacleLanes(none, np.zeros(1, np.int64), table(ObstaclePart, 0))
    base: list[int] = []
    start: list[int] = [0]
    parts: list[Any] = []
    for b, net in enumerate(nets):
        span = slice(int(obstacles.off[b]), int(obstacles.off[b + 1]))
        if span.start == span.stop:
            base.append(-1)
            continue
        base.append(len(start) - 1)
        for row in range(int(roads.seg_off[net]), int(roads.seg_off[net + 1])):
            half_width = float(roads.half_width[net])
            if roads.segment[row].piece >= 0:
                beside = on_bend(obstacles.parts[span], roads, row, half_width)
            else:
                part, reaches = _on_segment(obstacles.parts[span], roads.segment[row], half_width)
                beside = part[reaches]
            parts.append(beside)
            start.append(start[-1] + len(beside))
    rows = table(ObstaclePart, start[-1])
    cast(Any, rows)[:] = np.concatenate(parts)
    return ObstacleLanes(np.array(base, dtype=np.int64), np.array(start, dtype=np.int64), rows)


def on_bend(parts: Rows[Part], roads: RoadTable, row: int, half_width: float) -> Any:
    """Return the parts of obstacles beside a segment that bends, in its coordinates, (P,).

    A disc stays a disc. An edge becomes points at most `STEP` metres apart, joined by straight lines. Points off the
    road count as on the road's edge.

    Norm: docs/rules.md#obstacle-on-a-bend.
    """
    segment, spans, beside = roads.segment[row], list[tuple[float, ...]](), set[int]()
    for p in range(len(parts)):
        edge = half_width + parts[p].reach
        if bent_distance2(roads.piece, segment, parts[p].x, parts[p].y) < edge * edge:
            beside.add(parts[p].owner)
    for p in range(len(parts)):
        if parts[p].owner in beside:
            spans += _bits(parts[p], roads, row, half_width)
    rows: Any = table(ObstaclePart, len(spans))
    for k, bit in enumerate(spans):
        rows[k] = bit
    return rows


def _bits(part: Part, roads: RoadTable, row: int, half_width: float) -> list[tuple[float, ...]]:
    """Return the pieces of one part beside a segment that bends, each as the fields of an `ObstaclePart`."""
    segment, length = roads.segment[row], roads.segment[row].length
    if part.half_length == 0.0:
        along, left = bent_coordinates(roads.piece, segment, False, part.x, part.y)
        beside = along + part.rounding >= 0.0 and along - part.rounding <= length
        return [(along, left, along, left, part.rounding, part.owner)] if beside else []
    count = max(1, ceil(2.0 * part.half_length / STEP - 1e-9))
    spots: list[tuple[float, float]] = []
    for k in range(count + 1):
        gone = (2.0 * k / count - 1.0) * part.half_length
        x, y = part.x + gone * part.c, part.y + gone * part.s
        along, left = bent_coordinates(roads.piece, segment, False, x, y)
        spots.append((along, min(max(left, -half_width), half_width)))
    return [
        (s0, l0, s1, l1, 0.0, part.owner)
        for (s0, l0), (s1, l1) in pairwise(spots)
        if max(s0, s1) >= 0.0 and min(s0, s1) <= length and (abs(s1 - s0) <= LEAP or min(abs(l0), abs(l1)) < half_width)
    ]


def _on_segment(parts: Rows[Part], segment: Segment, half_width: float) -> tuple[Any, Any]:
    """Return the parts (P,) in the coordinates of a straight segment, and which of them are beside it, (P,)."""
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
        there = reaches & (owner == number)
        if left[there].max() <= -half_width or right[there].min() >= half_width:
            reaches[there] = False
    return rows, reaches
