"""Small batches without roads, for tests of motion and sensing."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

from dubins_traffic.cars.body import Car, Obstacle
from dubins_traffic.cars.state import Pose
from dubins_traffic.kernels.trig import sincos


def pose(x: float, y: float, theta: float = 0.0) -> Pose:
    """Return a pose by angle."""
    return Pose(x, y, *sincos(theta))


def scene(
    starts: Sequence[Pose], car: Car | None = None, obstacles: Sequence[Obstacle] = (), rate: float = 30.0
) -> Any:
    """Return what the embedded simulator reads of an instance: no network is needed to move."""
    problem = SimpleNamespace(rate=rate, car=car or Car(), obstacles=tuple(obstacles))
    return SimpleNamespace(problem=problem, starts=tuple(starts))
