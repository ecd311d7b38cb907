"""What rules 2 and 3 need of a network, in numbers: how long, how far apart (docs/rules.md#room)."""

from __future__ import annotations

from typing import NamedTuple

LEAST_RADIUS = 2.9
"""R is at least this many w."""
SEGMENT_SLACK = 0.5
LARGEST_DEGREE = 4
"""Most roads at an intersection."""


class Clearances(NamedTuple):
    """What a network must keep.

    Attributes
    ----------
    length, apart, aside : float
        Least metres: length of a segment, between intersections, from an intersection to a segment beside it.
    cosine : float
        Two segments that meet make an angle with a smaller cosine.
    """

    length: float
    apart: float
    aside: float
    cosine: float

    def in_units(self, unit: float) -> Clearances:
        """Return the same for a lattice whose unit is `unit` metres."""
        return Clearances(self.length / unit, self.apart / unit, self.aside / unit, self.cosine)


def clearances(radius: float, reach: float, w: float, slack: float = SEGMENT_SLACK) -> Clearances:
    """Return what docs/rules.md#room demands for discs of `radius` R, bodies of `reach` rho and cars of width `w`.

    The roads of two arms that are 2 asin(2w / (R + rho)) apart or less overlap beyond the disc: a car would get from
    one to the other beside the all-way stop.
    """
    both = radius + reach
    sine = 2.0 * w / both
    return Clearances(2.0 * both + slack, 2.0 * both, both + 2.0 * w, 1.0 - 2.0 * sine * sine)
