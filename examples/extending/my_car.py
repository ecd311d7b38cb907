"""A car model of one's own: a bicycle that speeds up and steers in time (docs/extending/car-model.md).

In a configuration: "car": {"model": "examples/extending/my_car.py:Bicycle", "bounds": {"turning_radius": 0.25}}
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import dubins_traffic as dt


class Bicycle:
    """Speeds up, brakes and steers at limited rates; it can't turn in place."""

    parameters: ClassVar = {"acceleration": 1.5, "braking": 3.0, "steering": 12.0, "parts": 3}

    def begin(self, car: dt.Car, period: float, parameters: Mapping[str, Any]) -> None:
        """Stand, with the wheels straight."""
        radius = car.bounds.turning_radius
        self._sharpest = 1.0 / radius if radius > 0.0 else 4.0
        self._parts = int(parameters["parts"])
        self._step = period / self._parts
        self._gain = parameters["acceleration"] * self._step
        self._loss = parameters["braking"] * self._step
        self._turn = parameters["steering"] * self._step
        self._speed = self._bend = 0.0

    def clip(self, speed: float, yaw_rate: float) -> tuple[float, float]:
        """Take any command."""
        return speed, yaw_rate

    def advance(self, speed: float, yaw_rate: float) -> Sequence[tuple[float, float, float]]:
        """Let speed and curvature come nearer to what is asked for, part by part."""
        bend = yaw_rate / speed if speed != 0.0 else self._bend
        bend = min(max(bend, -self._sharpest), self._sharpest)
        arcs: list[tuple[float, float, float]] = []
        for _ in range(self._parts):
            slower = abs(speed) < abs(self._speed) or speed * self._speed < 0.0
            self._speed = _nearer(self._speed, speed, self._loss if slower else self._gain)
            self._bend = _nearer(self._bend, bend, self._turn)
            arcs.append((self._speed, self._speed * self._bend, self._step))
        return arcs

    def stop(self) -> None:
        """A contact has fixed it: it must speed up anew."""
        self._speed = 0.0


def _nearer(value: float, goal: float, most: float) -> float:
    """Return a value that is by `most` at most nearer to a goal."""
    return min(max(goal, value - most), value + most)
