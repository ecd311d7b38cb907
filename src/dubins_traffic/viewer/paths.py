"""A sketch of the ways of the cars in a trial: small enough to be kept with its result."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dubins_traffic.cars.state import Frames, Pose
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.sink import Ending
from dubins_traffic.viewer.shapes import poses_at

STEPS = 400
"""Most points of a way, about."""
CARS = 60
"""Most cars whose ways are kept."""


class Paths:
    """A sink that keeps every k-th position of the first cars, and the last pose of all cars."""

    forks = True

    def __init__(self) -> None:
        self._step = 1
        self._points: list[Floats] = []
        self._end: Floats | None = None
        self.last: Sequence[Pose] = ()

    @classmethod
    def of(cls, instance: Instance, frames: Frames) -> Paths:
        """Return the ways in a block of frames."""
        made = cls()
        made.begin(instance)
        made.frames(frames)
        return made

    def begin(self, instance: Instance) -> None:
        """Choose how many positions are kept."""
        self._step = max(1, instance.ticks // STEPS)
        self._points, self._end, self.last = [], None, ()

    def frames(self, frames: Frames) -> None:
        """Keep some positions."""
        if len(frames) == 0:
            return
        first = -frames.first % self._step
        xy: Floats = np.stack([frames.x[:, :CARS], frames.y[:, :CARS]], axis=-1)
        self._points.append(xy[first :: self._step].copy())
        self._end = xy[-1:].copy()
        self.last = poses_at(frames, -1)

    def end(self, ending: Ending) -> None:
        """Nothing is left to keep."""

    def lines(self) -> list[Floats]:
        """Return the way of each car, (P, 2) metres, world frame; none before the first frame."""
        if self._end is None:
            return []
        xy = np.concatenate([*self._points, self._end])
        return [xy[:, car] for car in range(xy.shape[1])]
