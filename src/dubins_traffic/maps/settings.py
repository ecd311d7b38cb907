"""What a road network must keep so that rules 2 and 3 can be judged on it, in the metres of a map."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import acos, isfinite, pi
from typing import NamedTuple

from dubins_traffic.errors import InputError
from dubins_traffic.maps.fitting import Limits
from dubins_traffic.roads.room import LEAST_RADIUS, SEGMENT_SLACK, Clearances, clearances

SPARE = 1e-3
"""What is made is larger than what is demanded by this share."""
W = 0.3
"""Half the width of a lane of networks that do not say another, metres."""
HALF_TURN = 9.0
"""Points of a road this many w apart along it are apart like those of two roads."""
LEAST_BEND = 3.0
"""Arcs of a road have a radius of at least this many w."""


class Room(NamedTuple):
    """What a network must keep, metres of the map.

    Attributes
    ----------
    apart, aside, roads : float
        Least distances between intersections, from an intersection to a road beside it, and between roads.
    straight, half_turn : float
        Roads that meet may be nearer than that so far from where they meet; so may points of one road so far along it.
    """

    apart: float
    aside: float
    roads: float
    straight: float
    half_turn: float


@dataclass(frozen=True, slots=True)
class ImportSettings:
    """How a road map becomes a network.

    Parameters
    ----------
    w, radius, reach, slack : float
        Half the width of a lane, intersection radius R (default w / 0.3 m), reach rho of bodies and slack of segments,
        metres of the network (docs/rules.md#room).
    scale : float, optional
        Metres of the network in one metre of the map; by default the usual lane of the map becomes 2w wide.
    tolerance : float
        How far a road may be from that of the map where it counts as kept, metres of the map.
    pairs : float
        One-way roads beside each other, one for each direction, that are at most so many metres of the map apart, 1 to
        200, become one road (`maps.pairs`); 0: none do.
    """

    w: float = W
    radius: float | None = None
    reach: float = 0.177
    slack: float = SEGMENT_SLACK
    scale: float | None = None
    tolerance: float = 0.1
    pairs: float = 0.0

    def __post_init__(self) -> None:
        for name, low, high in (
            ("w", 1e-3, 1e3),
            ("reach", 0.0, 1e3),
            ("slack", 0.0, 1e3),
            ("tolerance", 1e-6, 1e3),
        ):
            self._check(name, getattr(self, name), low, high)
        if self.pairs != 0.0:
            self._check("pairs", self.pairs, 1.0, 200.0)
        if self.scale is not None:
            self._check("scale", self.scale, 1e-6, 1e6)
        self._check("radius", self.disc, LEAST_RADIUS * self.w - 1e-9, 1e4)

    def with_lanes(self, width: float) -> ImportSettings:
        """Return the same with half the width of a lane of the map (metres of it) as `w`, at the scale.

        Reach and slack grow with `w`: at bends wider roads need more room beside intersections.
        """
        w = 0.5 * width * (1.0 if self.scale is None else self.scale)
        return replace(self, w=w, reach=self.reach * w / self.w, slack=self.slack * w / self.w)

    def _check(self, name: str, value: float, low: float, high: float) -> None:
        if not (isfinite(value) and low <= value <= high):
            raise InputError("out of range", field=name, value=value, expected=f"a number in [{low:g}, {high:g}]")

    @property
    def disc(self) -> float:
        """Intersection radius R, metres of the network."""
        return self.w / 0.3 if self.radius is None else self.radius

    @property
    def _clearances(self) -> Clearances:
        return clearances(self.disc, self.reach, self.w, self.slack)

    def room(self, scale: float) -> Room:
        """Return what a network must keep in metres of the map."""
        wide = (1.0 + SPARE) / scale
        metres = self._clearances
        return Room(
            metres.apart * wide,
            metres.aside * wide,
            (4.0 * self.w + self.reach) * wide,
            (self.disc + self.reach + self.slack) / wide / scale**2,
            HALF_TURN * self.w / scale,
        )

    @property
    def least_angle(self) -> float:
        """Least angle between two arms, radians."""
        return acos(max(-1.0, self._clearances.cosine)) + SPARE * pi

    def limits(self, scale: float) -> Limits:
        """Return the limits of a fit in metres of the map."""
        wide = (1.0 + SPARE) / scale
        straight = (self.disc + self.reach + self.slack) * wide
        return Limits(self.tolerance, LEAST_BEND * self.w * wide, straight)
