"""A simulator of one's own: motors that turn in steps, moved as the embedded simulator moves cars."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from dubins_traffic.cars.state import Contact, State
from dubins_traffic.problem.instance import Instance
from dubins_traffic.protocols import Capabilities
from dubins_traffic.simulators.embedded import Embedded

STEP = np.array([0.002, 0.002])
"""The motors turn at whole multiples of these: m/s and rad/s."""


class Stepping:
    """Rounds the command of every car to what its motors can do."""

    capabilities = Capabilities(batched=True, deterministic=True, lockstep=True, forks=True)

    def __init__(self) -> None:
        self._exact = Embedded()

    def reset(self, instances: Sequence[Instance]) -> State:
        """Place the cars of a batch."""
        return self._exact.reset(instances)

    def step(self, commands: npt.NDArray[np.float64]) -> Sequence[Sequence[Contact]]:
        """Clip and round `commands` (B, N, 2) in place, move for one tick and return the contacts of each trial."""
        commands[...] = np.rint(commands / STEP) * STEP
        return self._exact.step(commands)

    def close(self) -> None:
        """Nothing is held."""
