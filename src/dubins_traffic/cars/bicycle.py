"""The bicycle: speed and steering angle are states that change at limited rates (docs/extending/car-model.md)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil
from typing import Any, ClassVar

from dubins_traffic.cars.body import Car
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.angles import sincos

FINEST = 1.0 / 240.0
"""Longest time for which the curvature is held, seconds; so the arcs are within 1e-4 m of the exact motion."""
MOST_PARTS = 200
"""Most parts into which a tick is divided."""
LEAST, MOST = 1e-6, 1e6
"""Bounds on every parameter: beyond them the yaw rate of an arc may overflow, whatever the command."""
STEEPEST = 1.5
"""Largest tangent of the steering angle: a wheel at 56 degrees."""


class Bicycle:
    """A car that speeds up, brakes and steers at limited rates, with `wheelbase` metres between its axles.

    It can't turn in place. A command asks for a speed and, as yaw rate over speed, for a curvature of its path; a
    command to stand leaves the wheel as it is. The speed rises by `acceleration` (m/s^2) and falls, also through 0, by
    `braking` (m/s^2); the steering angle changes by `steering_rate` (rad/s). The curvature is the tangent of that angle
    over `wheelbase` (m).
    """

    parameters: ClassVar = {"wheelbase": 0.2, "acceleration": 1.5, "braking": 3.0, "steering_rate": 2.0}

    def begin(self, car: Car, period: float, parameters: Mapping[str, Any]) -> None:
        """Begin a trial: the car stands, with the wheel straight.

        Raises
        ------
        InputError
            If a parameter is no number from `LEAST` to `MOST`.
        """
        for name, value in parameters.items():
            if isinstance(value, bool) or not isinstance(value, int | float) or not LEAST <= value <= MOST:
                expected = f"a number from {LEAST:g} to {MOST:g}"
                raise InputError(
                    "out of range", field=f"car.parameters.{name}", value=value, expected=expected
                )
        self._base = float(parameters["wheelbase"])
        self._gain, self._loss = float(parameters["acceleration"]), float(parameters["braking"])
        parts = min(max(1, ceil(period / FINEST - 1e-9)), MOST_PARTS)
        self._parts = parts
        self._step = period / parts
        cosine, sine = sincos(min(0.5 * float(parameters["steering_rate"]) * self._step, 0.5))
        self._half_turn = sine / cosine
        radius = car.bounds.turning_radius
        self._most = min(self._base / radius, STEEPEST) if radius > 0.0 else STEEPEST
        self._speed = self._tangent = 0.0

    def clip(self, speed: float, yaw_rate: float) -> tuple[float, float]:
        """Return the command unchanged: it sets the targets of speed and steering angle, which are approached."""
        return speed, yaw_rate

    def advance(self, speed: float, yaw_rate: float) -> Sequence[tuple[float, float, float]]:
        """Return the arcs of the tick: each has the mean speed of its two ends, and the curvature of its middle."""
        wanted = self._base * yaw_rate / speed if speed != 0.0 else self._tangent
        wanted = min(max(wanted, -self._most), self._most)
        arcs: list[tuple[float, float, float]] = []
        for _ in range(self._parts):
            middle = _turned(self._tangent, wanted, self._half_turn)
            self._tangent = _turned(middle, wanted, self._half_turn)
            for mean, seconds in self._speeds(speed):
                arcs.append((mean, mean * middle / self._base, seconds))
        return arcs

    def stop(self) -> None:
        """Set the speed to 0, since a contact has fixed the car; the wheel stays as it is."""
        self._speed = 0.0

    def _speeds(self, goal: float) -> Sequence[tuple[float, float]]:
        """Change the speed toward `goal` for one part of the tick; return (mean speed, m/s, seconds) of its pieces.

        There are two pieces if the goal is reached within the part.
        """
        found: list[tuple[float, float]] = []
        left = self._step
        while left > 0.0 and self._speed != goal:
            through = self._speed * goal < 0.0
            target = 0.0 if through else goal
            rate = self._loss if abs(target) < abs(self._speed) else self._gain
            needed = abs(target - self._speed) / rate
            before = self._speed
            if needed <= left:
                self._speed = target
                spent = needed
            else:
                self._speed += rate * left if target > before else -rate * left
                spent = left
            found.append((0.5 * (before + self._speed), spent))
            left -= spent
        if left > 0.0:
            found.append((self._speed, left))
        return found


def _turned(tangent: float, wanted: float, step: float) -> float:
    """Return the tangent of a steering angle turned toward tangent `wanted` by the angle whose tangent is `step`."""
    if wanted > tangent:
        below = 1.0 - tangent * step
        return min((tangent + step) / below, wanted) if below > 0.0 else wanted
    return max((tangent - step) / (1.0 + tangent * step), wanted) if 1.0 + tangent * step > 0.0 else wanted
