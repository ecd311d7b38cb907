"""The ego and each other car as two discs: where they are, how fast they come nearer, and the least of a value."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar, NamedTuple

import numpy as np

from dubins_traffic.cars.state import EGO, Frames
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import Instance, Problem
from dubins_traffic.record.sink import Ending
from dubins_traffic.scoring.metric import Column, Value


class Others(NamedTuple):
    """Places (m) and velocities (m/s) of the other cars as seen from the ego's place, world axes: each (F, N - 1)."""

    x: Floats
    y: Floats
    vx: Floats
    vy: Floats


def others_of(frames: Frames) -> Others:
    """Return where the other cars are in each frame, and how fast they move, against the ego."""
    vx, vy = frames.speed * frames.c, frames.speed * frames.s
    return Others(*(row[:, EGO + 1 :] - row[:, EGO, None] for row in (frames.x, frames.y, vx, vy)))


def touching_distance(problem: Problem) -> float:
    """Return the distance in metres at which the discs around two bodies touch."""
    return 2.0 * problem.car.body.reach


class LeastOfPairs:
    """A metric of two columns: the least value of the ego and another car, and the share of frames below a threshold.

    A subclass has the columns, the threshold, and `values`. Without a finite value the least is None.
    """

    columns: ClassVar[tuple[Column, Column]]
    threshold: ClassVar[float]

    def begin(self, instance: Instance) -> None:
        """Start without a frame."""
        self.touch = touching_distance(instance.problem)
        self._least = math.inf
        self._below = 0
        self._count = 0

    def frames(self, frames: Frames) -> None:
        """Take a block of frames."""
        self._count += len(frames)
        if frames.x.shape[1] == 1 or not len(frames):
            return
        least = self.values(frames).min(axis=1)
        self._least = min(self._least, float(least.min()))
        self._below += int(np.count_nonzero(least < self.threshold))

    def end(self, ending: Ending) -> None:
        """Nothing is left to do."""

    def result(self) -> Mapping[str, Value]:
        """Return the least value and the share up to the last frame."""
        least, share = self.columns
        return {
            least.name: None if math.isinf(self._least) else self._least,
            share.name: self._below / max(1, self._count),
        }

    def values(self, frames: Frames) -> Floats:
        """Return the value of each other car in each frame, infinite where there is none: (F, N - 1)."""
        raise NotImplementedError
