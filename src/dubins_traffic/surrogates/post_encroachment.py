"""The metric `post_encroachment`: how soon after one car had left a place the other came to it.

Source: B. L. Allen, B. T. Shin, P. J. Cooper, *Analysis of traffic conflicts and collisions*, 1978 (post-encroachment
time).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

import numpy as np
import numpy.typing as npt

from dubins_traffic.cars.state import EGO, Frames
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.sink import Ending
from dubins_traffic.scoring.metric import Column, Value
from dubins_traffic.surrogates.pairs import touching_distance

HORIZON: Final = 10.0
"""Seconds after which nobody has to do with who was there before."""


class PostEncroachment:
    """Least time from one car's leaving a place to the other's coming there, of the ego and another car.

    Cars are the discs around their bodies. In each frame of the one, the last earlier frame of the other counts in
    which the two discs would overlap. It is 0 where they overlap at one time; behind a car it is the time gap.
    """

    columns = (
        Column(
            "min_post_encroachment_s",
            "least post-encroachment time",
            "s",
            1,
            meaning="least time from the ego's or another car's leaving a place to the other one's coming there, "
            "both as discs around their bodies; null if never within 10 s",
            short="least PET",
        ),
    )

    def begin(self, instance: Instance) -> None:
        """Start without a frame."""
        problem = instance.problem
        self._touch = touching_distance(problem)
        self._kept = math.floor(HORIZON * problem.rate)
        self._rate = problem.rate
        self._least = math.inf
        self._earlier = np.empty((2, 0, len(instance.names)))

    def frames(self, frames: Frames) -> None:
        """Take a block of frames, and keep the frames that later ones may have to do with."""
        places = np.concatenate((self._earlier, np.stack((frames.x, frames.y))), axis=1)
        first = self._earlier.shape[1]
        for now in range(first, places.shape[1]):
            ticks = self._ticks_since(places[:, max(0, now - self._kept) : now + 1])
            self._least = min(self._least, ticks / self._rate)
        self._earlier = places[:, max(0, places.shape[1] - self._kept) :]

    def end(self, ending: Ending) -> None:
        """Nothing is left to do."""

    def result(self) -> Mapping[str, Value]:
        """Return the least time up to the last frame."""
        return {"min_post_encroachment_s": None if math.isinf(self._least) else self._least}

    def _ticks_since(self, places: Floats) -> float:
        """Return the least ticks from an overlap to the last of some frames, infinite without any.

        Parameters
        ----------
        places : array (2, K, N)
            The centres of the cars in consecutive frames, metres.
        """
        now = places[:, -1, :]
        ego = _overlap(now[:, None, EGO, None], places[:, :, EGO + 1 :], self._touch)
        others = _overlap(places[:, :, EGO, None], now[:, None, EGO + 1 :], self._touch)
        when = np.flatnonzero((ego | others).any(axis=1))
        return float(places.shape[1] - 1 - when[-1]) if len(when) else math.inf


def _overlap(ego: Floats, others: Floats, touch: float) -> npt.NDArray[np.bool_]:
    """Tell for places of the ego and of others, (2, K or 1, N - 1 or 1), whether they are nearer than `touch`."""
    x, y = others - ego
    return x * x + y * y < touch * touch
