"""What a car is: its width, body and bounds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from dubins_traffic.cars.read_only import read_only
from dubins_traffic.errors import InputError

KOBUKI_RADIUS = 0.177
DUBINS = "dubins"
"""The default car model: a command holds at once and for the whole tick."""


@dataclass(frozen=True, slots=True)
class Disc:
    """A round body of `radius` metres about the car's centre."""

    radius: float = KOBUKI_RADIUS

    def __post_init__(self) -> None:
        _positive("radius", self.radius)

    @property
    def reach(self) -> float:
        """Distance from the centre to the farthest point of the body, in metres (rho in docs/rules.md#road)."""
        return self.radius

    @property
    def width(self) -> float:
        """Extent across the heading, in metres."""
        return 2.0 * self.radius


@dataclass(frozen=True, slots=True)
class Rectangle:
    """A rectangular body, `length` along the heading and `width` across it, about the car's centre."""

    length: float
    width: float

    def __post_init__(self) -> None:
        _positive("length", self.length)
        _positive("width", self.width)

    @property
    def reach(self) -> float:
        """Half the diagonal, in metres (rho in docs/rules.md#road)."""
        return 0.5 * math.sqrt(self.length * self.length + self.width * self.width)


Body = Disc | Rectangle


@dataclass(frozen=True, slots=True)
class Bounds:
    """Bounds on the commands of a car.

    Parameters
    ----------
    speed : float
        Largest speed, m/s; without `speed_min` the car may reverse as fast.
    yaw_rate : float
        Largest yaw rate either way, rad/s.
    speed_min : float, optional
        Smallest speed, m/s. With ``speed_min > 0`` and `turning_radius` the car follows Dubins curves.
    turning_radius : float
        Smallest turning radius, metres: ``abs(yaw rate)`` <= ``abs(speed)`` / turning_radius. 0 for none.
    """

    speed: float = 0.7
    yaw_rate: float = math.pi
    speed_min: float | None = None
    turning_radius: float = 0.0

    def __post_init__(self) -> None:
        _positive("speed", self.speed)
        _positive("yaw_rate", self.yaw_rate)
        if not (math.isfinite(self.turning_radius) and self.turning_radius >= 0):
            raise InputError(
                "not a radius", field="turning_radius", value=self.turning_radius, expected="a number >= 0"
            )
        low = self.speed_low
        if not (math.isfinite(low) and low <= self.speed):
            raise InputError("not a smallest speed", field="speed_min", value=low, expected=f"a number <= {self.speed}")

    @property
    def speed_low(self) -> float:
        """The smallest admissible speed, m/s (negative: reverse)."""
        return -self.speed if self.speed_min is None else self.speed_min


@dataclass(frozen=True, slots=True)
class Car:
    """What the cars of a trial are; all of them are alike.

    `w` is the nominal width in metres that sets the roads: lanes are 2w wide, roads 4w (paper, II.A). The body
    that collides is `body`. `model` is the name of the car model (`cars.dynamics`) or ``module:Class`` of a user's;
    `parameters` are the values given to it.

    Norm: docs/rules.md#road.
    """

    w: float = 0.3
    body: Body = field(default_factory=Disc)
    bounds: Bounds = field(default_factory=Bounds)
    model: str = DUBINS
    parameters: Mapping[str, Any] = field(default_factory=dict[str, Any], hash=False)

    def __post_init__(self) -> None:
        _positive("w", self.w)
        object.__setattr__(self, "parameters", read_only(self.parameters))

    @property
    def lane_width(self) -> float:
        """2w, metres."""
        return 2.0 * self.w

    @property
    def road_width(self) -> float:
        """4w, metres."""
        return 4.0 * self.w

    @property
    def point_speed(self) -> float:
        """The speed that no point of the body exceeds, m/s."""
        turns = self.bounds.yaw_rate * self.body.reach if isinstance(self.body, Rectangle) else 0.0
        return max(self.bounds.speed, -self.bounds.speed_low) + turns


@dataclass(frozen=True, slots=True)
class DiscObstacle:
    """A static disc: centre (x, y) and radius, metres, world frame."""

    x: float
    y: float
    radius: float


@dataclass(frozen=True, slots=True)
class PolygonObstacle:
    """A static simple polygon, vertices in metres, world frame; convex or not."""

    vertices: tuple[tuple[float, float], ...]


Obstacle = DiscObstacle | PolygonObstacle


def _positive(name: str, value: float) -> None:
    if not (math.isfinite(value) and value > 0):
        raise InputError(f"not a {name.replace('_', ' ')}", field=name, value=value, expected="a number > 0")
