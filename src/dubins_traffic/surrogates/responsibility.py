"""The metric `rss`: how much more than the distance of responsibility-sensitive safety the ego keeps.

Source: S. Shalev-Shwartz, S. Shammah, A. Shashua, *On a formal model of safe and scalable self-driving cars*, 2017,
Definitions 1 and 2. The ego may react late; it drives at its top speed at most.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from dubins_traffic.cars.state import EGO, Frames
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import Instance
from dubins_traffic.scoring.metric import Column
from dubins_traffic.surrogates.pairs import LeastOfPairs, others_of

RESPONSE: Final = 0.5
"""Seconds in which a car may do anything before it brakes."""
ACCELERATION: Final = 1.5
BRAKING: Final = 3.0
"""What a car may gain in that time, and how it brakes from then on, m/s^2: the defaults of the car model `bicycle`."""


class Safe(NamedTuple):
    """The response of a car: its top speed in m/s, and how fast it speeds up and brakes in m/s^2."""

    top_speed: float
    acceleration: float = ACCELERATION
    braking: float = BRAKING

    def path(self, speed: Floats) -> Floats:
        """Return how far (m) a car comes from a speed (m/s, >= 0) that speeds up for `RESPONSE` and then brakes."""
        top = np.maximum(speed, self.top_speed)
        later = np.minimum(speed + self.acceleration * RESPONSE, top)
        rising = (later - speed) / self.acceleration
        gained = 0.5 * (speed + later) * rising + later * (RESPONSE - rising)
        return gained + self.stopping(later)

    def stopping(self, speed: Floats) -> Floats:
        """Return how far a car comes from a speed (m/s) that brakes at once, metres."""
        return speed * speed / (2.0 * self.braking)

    def distance(self, ego: Floats, other: Floats) -> Floats:
        """Return the distance that a car of the speed `ego` keeps from one ahead, metres.

        Parameters
        ----------
        ego : array
            Speed at which it drives toward the other, m/s, at least 0.
        other : array
            Speed of the other in the same direction, m/s; below 0 it comes nearer.
        """
        ahead = np.maximum(self.path(ego) - self.stopping(other), 0.0)
        return np.where(other < 0.0, self.path(ego) + self.path(np.abs(other)), ahead)


class ResponsibilitySensitiveSafety(LeastOfPairs):
    """Least distance beyond that of responsibility-sensitive safety to a car in the ego's way, and the share below it.

    In a frame in which the ego drives, a car is in its way if the discs around their bodies would meet if the ego went
    on straight. The distance asked for is that of the ego's speed, and of the other's along the ego's direction.
    """

    columns = (
        Column(
            "min_rss_margin_m",
            "least distance beyond that of RSS",
            "m",
            1,
            meaning="least distance, beyond the one that responsibility-sensitive safety asks for, to a car in the "
            "ego's way while the ego drives; null if there never is one",
            short="least RSS margin",
        ),
        Column(
            "below_rss_share",
            "nearer than RSS asks for",
            "share",
            -1,
            meaning="share of the frames in which that distance is below 0",
            short="below RSS",
        ),
    )

    threshold = 0.0

    def begin(self, instance: Instance) -> None:
        """Start without a frame."""
        super().begin(instance)
        self._safe = Safe(instance.problem.car.bounds.speed)

    def values(self, frames: Frames) -> Floats:
        """Return by how much (m) each other car is farther than RSS asks for, infinite out of the way: (F, N - 1)."""
        speed = frames.speed[:, EGO, None]
        forward = np.sign(speed)
        c, s = forward * frames.c[:, EGO, None], forward * frames.s[:, EGO, None]
        seen = others_of(frames)
        ahead, beside = seen.x * c + seen.y * s, seen.y * c - seen.x * s
        square = self.touch * self.touch - beside * beside
        in_way = (ahead > 0.0) & (square > 0.0) & (forward != 0.0)
        gap = ahead - np.sqrt(np.maximum(square, 0.0))
        ego = np.abs(speed)
        along = seen.vx * c + seen.vy * s + ego
        return np.where(in_way, gap - self._safe.distance(ego, along), np.inf)
