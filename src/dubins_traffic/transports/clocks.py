"""The two clocks of a trial with remote drivers: one waits for everybody, one for nobody."""

from __future__ import annotations

import math

from dubins_traffic.transports.patience import seconds

NEVER = -math.inf


class Lockstep:
    """The simulation waits for the command of every tick, `deadline` seconds at most (a `protocols.Clock`)."""

    lockstep = True
    factor = 0.0

    def __init__(self, deadline: float = 5.0) -> None:
        self._deadline = seconds(deadline, "--deadline")

    def start(self, period: float, now: float) -> None:
        """Nothing is timed."""

    def due(self, tick: int) -> float:  # noqa: ARG002  # the same for all
        """Return a time that is past."""
        return NEVER

    def until(self, tick: int, now: float) -> float:  # noqa: ARG002  # the same for all
        """Return `now` and the deadline."""
        return now + self._deadline

    def shift(self, seconds: float) -> None:
        """Nothing is timed."""


class RealTime:
    """Simulated time keeps pace with the wall clock, `factor` times as fast (a `protocols.Clock`).

    Frame k is due at k periods. The commands that answer it are waited for until frame k + 1 is due, and no longer:
    who answers within a tick gets the frames of lockstep; who is late leaves his last command in force.
    """

    lockstep = False

    def __init__(self, factor: float = 1.0) -> None:
        self.factor = seconds(factor, "--factor")
        self._period = 1.0
        self._zero = 0.0

    def start(self, period: float, now: float) -> None:
        """Frame 0 is due now."""
        self._period = period / self.factor
        self._zero = now

    def due(self, tick: int) -> float:
        """Return when frame `tick` is due."""
        return self._zero + tick * self._period

    def until(self, tick: int, now: float) -> float:  # noqa: ARG002  # nobody is given more time
        """Return when the next frame is due."""
        return self.due(tick + 1)

    def shift(self, seconds: float) -> None:
        """Put off all that is to come."""
        self._zero += seconds
