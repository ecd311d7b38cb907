"""The metric `time_to_collision`: how soon the ego would have met another car if no car had turned or braked.

Sources: J. C. Hayward, *Near-miss determination through use of a scale of danger*, 1972 (time to collision);
M. M. Minderhoud, P. H. L. Bovy, *Extended time-to-collision measures for road traffic safety assessment*, 2001 (time
exposed).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from dubins_traffic.cars.state import Frames
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.sink import Ending
from dubins_traffic.scoring.metric import Column, Value
from dubins_traffic.surrogates.pairs import Others, others_of, touching_distance

THRESHOLD = 1.5
"""Seconds to a collision below which the ego is exposed."""


class TimeToCollision:
    """Least time to a collision with another car, and the share of frames in which it is below 1.5 s.

    At each frame both cars go on at their present speeds and headings, and each is the disc around its body. The time
    is that until the discs touch: 0 where they overlap, infinite where they never will.
    """

    columns = (
        Column(
            "min_time_to_collision_s",
            "least time to a collision",
            "s",
            1,
            meaning="least time until the discs around the ego and another car would touch; null if never",
            short="least TTC",
        ),
        Column(
            "time_exposed_share",
            "time to a collision below 1.5 s",
            "share",
            -1,
            meaning="share of the frames in which that time is below 1.5 s",
            short="TTC < 1.5 s",
        ),
    )

    def begin(self, instance: Instance) -> None:
        """Start without a frame."""
        self._touch = touching_distance(instance.problem)
        self._least = math.inf
        self._exposed = 0
        self._count = 0

    def frames(self, frames: Frames) -> None:
        """Take a block of frames."""
        self._count += len(frames)
        if frames.x.shape[1] == 1 or not len(frames):
            return
        least = time_to_touch(others_of(frames), self._touch).min(axis=1)
        self._least = min(self._least, float(least.min()))
        self._exposed += int(np.count_nonzero(least < THRESHOLD))

    def end(self, ending: Ending) -> None:
        """Nothing is left to do."""

    def result(self) -> Mapping[str, Value]:
        """Return the least time and the share up to the last frame."""
        return {
            "min_time_to_collision_s": None if math.isinf(self._least) else self._least,
            "time_exposed_share": self._exposed / max(1, self._count),
        }


def time_to_touch(others: Others, touch: float) -> Floats:
    """Return the seconds until other cars come as near as `touch` (m), infinite where they never do: (F, N - 1)."""
    x, y, vx, vy = others
    square = vx * vx + vy * vy
    closing = -(x * vx + y * vy)
    over = x * x + y * y - touch * touch
    beside = x * vy - y * vx
    inner = square * touch * touch - beside * beside
    meets = (closing > 0.0) & (inner >= 0.0) & (square > 0.0)
    root = np.sqrt(np.where(meets, inner, 0.0))
    # The smaller root of the quadratic, in the form that loses no digits.
    later = np.where(meets, over / np.where(meets, closing + root, 1.0), np.inf)
    return np.where(over <= 0.0, 0.0, later)
