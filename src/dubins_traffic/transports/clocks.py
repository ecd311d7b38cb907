"""The two clocks of a trial with remote drivers: one waits for everybody, one for nobody; and how long."""

from __future__ import annotations

import math
from dataclasses import dataclass

from dubins_traffic.errors import InputError

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


@dataclass(frozen=True, slots=True)
class Patience:
    """How long peers are waited for, in seconds of wall clock, and how much they may send.

    `begin`: for the first command after the announcement. `silence`: in real time, without any command. `absence`:
    for a peer that went to come back. `settle`: in lockstep without tags, for further answers to the first frame,
    which is shown until it is answered. `flood`: commands a second of one car. `at_once`: whether a trial's time
    begins with its announcement; else it begins with the ego's first command, if that is remote. InputError if
    `begin` or `silence` is no positive, finite number.
    """

    begin: float = 60.0
    silence: float = 5.0
    absence: float = 2.0
    settle: float = 0.2
    flood: int = 1000
    at_once: bool = False

    def __post_init__(self) -> None:
        """Refuse what is no time, such as `nan`, for which nobody would ever be silent."""
        seconds(self.begin, "--begin")
        seconds(self.silence, "--silence")


def seconds(value: float, name: str) -> float:
    """Return `value`, of the option `name`; InputError if it is not a positive finite number."""
    if not 0.0 < value < math.inf:
        raise InputError("not a positive number", file=name, value=value, expected="a number > 0")
    return value
