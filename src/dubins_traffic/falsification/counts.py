"""What became of the trials of a search, in numbers."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dubins_traffic.falsification.cells import CELLS
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.scoring.notice import fault_notice


@dataclass(slots=True)
class Counts:
    """What became of the trials of a search: how many ran, and of these broke the assumption, failed, broke a rule.

    `faults` counts those that failed by their ends; `first_fault` says which was the first of them, and why.
    """

    trials: int = 0
    discarded: int = 0
    faulty: int = 0
    violated: int = 0
    unconfirmed: int = 0
    """Breaches that did not stand when they were judged afresh."""
    faults: dict[str, int] = field(default_factory=dict[str, int])
    first_fault: str = ""
    exercised: Ints = field(default_factory=lambda: np.zeros(CELLS, dtype=np.int64))
    broken: Ints = field(default_factory=lambda: np.zeros(CELLS, dtype=np.int64))

    def to_json(self) -> dict[str, Any]:
        """Return the counts as a JSON object."""
        names = ("trials", "discarded", "faulty", "violated", "unconfirmed", "faults", "first_fault")
        return {name: getattr(self, name) for name in names}

    def take_fault(self, number: int, fault: str) -> None:
        """Count trial `number` as one that ended by a fault, ``END: REASON``; nothing if it is empty."""
        if fault:
            end = fault.partition(":")[0]
            self.faulty += 1
            self.faults[end] = self.faults.get(end, 0) + 1
            self.first_fault = self.first_fault or f"trial {number}: {fault}"

    def fault_notice(self) -> str:
        """Return the notice that trials ended by a fault; empty if none did."""
        return fault_notice(self.faults, self.trials, self.first_fault)
