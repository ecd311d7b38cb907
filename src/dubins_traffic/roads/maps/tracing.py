"""How near points of a line are to a curve of parts, kept while parts of it are exchanged."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.roads.maps.polylines import nearest


class Trace(NamedTuple):
    """A curve of parts, and how near some points are to it.

    Attributes
    ----------
    points : array (N, 2)
        The points, in the order of their line.
    parts : sequence of array (M, 2)
        Points of the curve, part after part; none is empty.
    away : array (N,)
        The distance of each point to the curve.
    owner : array (N,)
        The part in which the side of the curve begins that is nearest to the point.
    """

    points: Floats
    parts: Sequence[Floats]
    away: Floats
    owner: Ints

    def exchanged(self, begin: int, end: int, new: Sequence[Floats]) -> Trace:
        """Return this with the parts from `begin` to before `end` exchanged for `new`.

        Points that were nearest to other parts are reckoned as far as before: they may be nearer to the new ones.
        """
        low = max(begin - 1, 0)
        touched = np.flatnonzero((self.owner >= low) & (self.owner < end))
        parts = [*self.parts[:begin], *new, *self.parts[end:]]
        local = [*self.parts[low:begin], *new, *(part[:1] for part in self.parts[end : end + 1])]
        away = self.away.copy()
        owner = np.where(self.owner >= end, self.owner + (len(new) - (end - begin)), self.owner)
        if len(touched):
            away[touched], own = _measured(self.points[touched], local)
            owner[touched] = low + own
        return Trace(self.points, parts, away, owner)


def traced(points: Floats, parts: Sequence[Floats]) -> Trace:
    """Return how near points (N, 2) are to a curve of two points or more."""
    return Trace(points, parts, *_measured(points, parts))


def _measured(points: Floats, parts: Sequence[Floats]) -> tuple[Floats, Ints]:
    away, side = nearest(points, np.concatenate(parts))
    return away, np.repeat(np.arange(len(parts)), [len(part) for part in parts])[side]
