"""What a road network must keep so that rules 2 and 3 can be judged on it, in the metres of a map."""

from __future__ import annotations

from dataclasses import dataclass
from math import acos, isfinite, pi

from dubins_traffic.errors import InputError
from dubins_traffic.roads.maps.fitting import Limits
from dubins_traffic.roads.room import LEAST_RADIUS, SEGMENT_SLACK, Clearances, clearances

SPARE = 1e-3
"""What is made is larger than what is demanded by this share."""
LEAST_BEND = 3.0
"""Arcs of a road have a radius of at least this many w."""


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
    """

    w: float = 0.3
    radius: float | None = None
    reach: float = 0.177
    slack: float = SEGMENT_SLACK
    scale: float | None = None
    tolerance: float = 0.1

    def __post_init__(self) -> None:
        for name, low, high in (
            ("w", 1e-3, 1e3),
            ("reach", 0.0, 1e3),
            ("slack", 0.0, 1e3),
            ("tolerance", 1e-6, 1e3),
        ):
            self._check(name, getattr(self, name), low, high)
        if self.scale is not None:
            self._check("scale", self.scale, 1e-6, 1e6)
        self._check("radius", self.disc, LEAST_RADIUS * self.w - 1e-9, 1e4)

    def _check(self, name: str, value: float, low: float, high: float) -> None:
        if not (isfinite(value) and low <= value <= high):
            raise InputError(
                "out of range", field=name, value=value, expected=f"a number in [{low:g}, {high:g}]"
            )

    @property
    def disc(self) -> float:
        """Intersection radius R, metres of the network."""
        return self.w / 0.3 if self.radius is None else self.radius

    @property
    def room(self) -> Clearances:
        """What a network must keep, metres of the network."""
        return clearances(self.disc, self.reach, self.w, self.slack)

    @property
    def least_angle(self) -> float:
        """Least angle between two arms, radians."""
        return acos(max(-1.0, self.room.cosine)) + SPARE * pi

    def limits(self, scale: float) -> Limits:
        """Return the limits of a fit in metres of the map."""
        wide = (1.0 + SPARE) / scale
        straight = (self.disc + self.reach + self.slack) * wide
        return Limits(self.tolerance, LEAST_BEND * self.w * wide, straight)
