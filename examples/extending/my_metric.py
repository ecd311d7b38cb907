"""A metric of one's own: how hard the ego turns (docs/extending/metric.md).

dubins-traffic run town --metric examples/extending/my_metric.py:Turning
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

import dubins_traffic as dt


class Turning:
    """Mean and largest sideways acceleration of the ego, speed times yaw rate."""

    columns = (
        dt.Column(
            "sideways_mean",
            "sideways, mean",
            "m/s2",
            -1,
            meaning="mean of |speed * yaw rate| over the frames",
        ),
        dt.Column("sideways_max", "sideways, largest", "m/s2", -1, meaning="largest |speed * yaw rate| at a frame"),
    )

    def begin(self, instance: dt.Instance) -> None:  # noqa: ARG002  # it needs nothing of the problem
        """Start without a frame."""
        self._sum, self._max, self._count = 0.0, 0.0, 0

    def frames(self, frames: dt.Frames) -> None:
        """Take a block of frames; column 0 of every array is the ego."""
        if not len(frames):
            return
        sideways = np.abs(frames.speed[:, 0] * frames.yaw_rate[:, 0])
        self._sum += float(sideways.sum())
        self._max = max(self._max, float(sideways.max()))
        self._count += len(frames)

    def end(self, ending: dt.Ending) -> None:
        """Nothing is left to do."""

    def result(self) -> Mapping[str, float]:
        """Return the values up to the last frame."""
        return {"sideways_mean": self._sum / max(1, self._count), "sideways_max": self._max}
