"""The metric `time_to_collision`: how soon the ego would have met another car if no car had turned or braked.

Sources: J. C. Hayward, *Near-miss determination through use of a scale of danger*, 1972 (time to collision);
M. M. Minderhoud, P. H. L. Bovy, *Extended time-to-collision measures for road traffic safety assessment*, 2001 (time
exposed).
"""

from __future__ import annotations

import numpy as np

from dubins_traffic.cars.state import Frames
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.scoring.metric import Column
from dubins_traffic.surrogates.pairs import LeastOfPairs, Others, others_of

THRESHOLD = 1.5
"""Seconds to a collision below which the ego is exposed."""


class TimeToCollision(LeastOfPairs):
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

    threshold = THRESHOLD

    def values(self, frames: Frames) -> Floats:
        """Return the seconds until the ego and each other car would touch, (F, N - 1)."""
        return time_to_touch(others_of(frames), self.touch)


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
