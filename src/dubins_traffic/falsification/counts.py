"""What became of the trials of a search, in numbers."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dubins_traffic.falsification.cells import CELLS
from dubins_traffic.kernels.arrays import Ints


@dataclass(slots=True)
class Counts:
    """What became of the trials of a search: how many ran, and of these broke the assumption, failed, broke a rule."""

    trials: int = 0
    discarded: int = 0
    faulty: int = 0
    violated: int = 0
    unconfirmed: int = 0
    """Breaches that did not stand when they were judged afresh."""
    exercised: Ints = field(default_factory=lambda: np.zeros(CELLS, dtype=np.int64))
    broken: Ints = field(default_factory=lambda: np.zeros(CELLS, dtype=np.int64))

    def to_json(self) -> dict[str, Any]:
        """Return the counts as a JSON object."""
        names = ("trials", "discarded", "faulty", "violated", "unconfirmed")
        return {name: getattr(self, name) for name in names}
