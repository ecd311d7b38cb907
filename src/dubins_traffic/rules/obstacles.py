"""The static obstacles of each trial in the coordinates of the segments on which they lie."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from dubins_traffic.cars.tables import ObstacleTable
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.roads.table import RoadTable


class ObstacleLanes(Tables):
    """Parts of obstacles by segment.

    Attributes
    ----------
    base : (B,) int64
        Where the segments of trial b begin in `start`; -1 for a trial without obstacles.
    start : int64
        Parts of segment s of trial b are those from start[base[b] + s] to start[base[b] + s + 1] - 1.
    part : (P, 5) float64
        Ends (s0, l0), (s1, l1) in the segment's first direction, and rounding; metres. Parts of one obstacle
        follow each other.
    owner : (P,) int64
        Number of the obstacle.
    """

    base: Ints
    start: Ints
    part: Floats
    owner: Ints


def place_obstacles(table: ObstacleTable, roads: RoadTable, nets: Ints) -> ObstacleLanes:
    """Return the parts of obstacles beside each segment, of those obstacles that reach 2w of its centre line."""
    if not len(table.part):
        none = np.full(len(nets), -1, dtype=np.int64)
        return ObstacleLanes(none, np.zeros(1, np.int64), np.zeros((0, 5)), np.zeros(0, np.int64))
    base: list[int] = []
    start: list[int] = [0]
    parts: list[Floats] = []
    owners: list[Ints] = []
    for b, net in enumerate(nets):
        own = slice(int(table.off[b]), int(table.off[b + 1]))
        if own.start == own.stop:
            base.append(-1)
            continue
        base.append(len(start) - 1)
        for segment in roads.seg[roads.seg_off[net] : roads.seg_off[net + 1]]:
            part, reaches = _on_segment(
                table.part[own], table.owner[own], segment, float(roads.half_width[net])
            )
            parts.append(part[reaches])
            owners.append(table.owner[own][reaches])
            start.append(start[-1] + int(reaches.sum()))
    return ObstacleLanes(
        np.array(base, dtype=np.int64),
        np.array(start, dtype=np.int64),
        np.concatenate([np.zeros((0, 5)), *parts]),
        np.concatenate([np.zeros(0, dtype=np.int64), *owners]),
    )


def _on_segment(
    part: Floats, owner: Ints, segment: Floats, half_width: float
) -> tuple[Floats, npt.NDArray[np.bool_]]:
    x, y, c, s, half_length, _, rounding, _ = part.T
    ax, ay, tx, ty, length = segment[:5]
    rows = np.empty((len(part), 5))
    for column, sign in ((0, -1.0), (2, 1.0)):
        px = x + sign * half_length * c - ax
        py = y + sign * half_length * s - ay
        rows[:, column] = px * tx + py * ty
        rows[:, column + 1] = py * tx - px * ty
    rows[:, 4] = rounding
    along = np.minimum(rows[:, 0], rows[:, 2]) - rounding, np.maximum(rows[:, 0], rows[:, 2]) + rounding
    across = np.minimum(rows[:, 1], rows[:, 3]) - rounding, np.maximum(rows[:, 1], rows[:, 3]) + rounding
    reaches = (along[1] >= 0.0) & (along[0] <= length)
    for number in np.unique(owner[reaches]):
        own = reaches & (owner == number)
        if across[1][own].max() <= -half_width or across[0][own].min() >= half_width:
            reaches[own] = False
    return rows, reaches
