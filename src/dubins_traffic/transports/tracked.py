"""What can be known of a world outside before a trial: how noisy its poses are, and how late commands take effect."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.random import CUT
from dubins_traffic.problem.instance import Problem
from dubins_traffic.problem.parts import Disturbances

STAND, TURN, SETTLE = 1.5, 0.8, 0.7
"""For how long cars stand, turn one way and back, and stand again while they are measured, seconds."""
RATE = 0.6
"""Yaw rate at which they turn, rad/s, if the car can."""
LATEST: Final = 0.5
"""Delays are looked for up to this, seconds."""
STEP = 0.001
"""Resolution of delays, seconds."""
LOSS = 0.05
"""Share of commands that may get lost in a world outside, where nobody says it: so short a time does not show it."""
WATCHED = 300
"""Ticks of motion after which it is looked whether commands take effect as late as is declared."""
LAGS = 20
"""Most ticks of delay that are told apart then."""
CLEAR = 0.5
"""A delay is told only if no other explains the motion half as well: the ratio of the squared errors."""


@dataclass(frozen=True, slots=True)
class Sample:
    """A car's pose as it came: at `time` (s), at (x, y), m, and `heading` (rad)."""

    time: float
    x: float
    y: float
    heading: float


@dataclass(frozen=True, slots=True)
class Measured:
    """What has been measured: `delay` (s, None where no car could be told to turn), and bounds of the noise.

    `position` (m) and `heading` (rad) are the largest deviations of standing cars from their mean pose, `interval` (s)
    is the longest time between two poses of a car.
    """

    delay: float | None
    position: float
    heading: float
    interval: float

    def disturbances(self, problem: Problem, noise: float | None = None, loss: float = LOSS) -> Disturbances:
        """Return them as what a problem declares; `noise` (m) replaces what was measured.

        A pose may be as old as the interval when it is read, and it is read a tick before the command that it leads to,
        so both count as delay.
        """
        ticks = 1 + math.ceil(((self.delay or 0.0) + self.interval) * problem.rate - 1e-9)
        position = self.position if noise is None else noise
        return Disturbances(
            command_delay=ticks, position_noise=position / CUT, heading_noise=self.heading / CUT,
            command_loss=loss, cars="all",
        )  # fmt: skip

    def told(self, problem: Problem, declared: Disturbances) -> str:
        """Return a line for people: what was found, and how finely stops can be judged."""
        late = "not known, --delay declares it" if self.delay is None else f"{1000.0 * self.delay:.0f} ms"
        ticks, speed = declared.command_delay, problem.car.bounds.speed
        finely = speed * ticks / problem.rate + CUT * declared.position_noise
        return (
            f"the world: commands take effect late ({late}; {ticks} ticks with the age of poses), poses are noisy by "
            f"up to {1000.0 * CUT * declared.position_noise:.1f} mm and {math.degrees(self.heading):.2f} degrees; "
            f"places are judged to {100.0 * finely:.1f} cm"
        )


@dataclass(frozen=True, slots=True)
class Turned:
    """Cars were told at `began` (s) to turn at `rate` (rad/s), at `back` (s) to turn back, at `stood` (s) to stand."""

    began: float
    back: float
    stood: float
    rate: float

    def way(self, times: Floats) -> Floats:
        """Return how far they have turned at `times` (s), rad, if they do at once what they are told."""
        first, second = self.back - self.began, self.stood - self.back
        turned: Floats = np.clip(times - self.began, 0.0, first) - np.clip(times - self.back, 0.0, second)
        return self.rate * turned


def measured(
    standing: Sequence[Sequence[Sample]],
    turning: Sequence[Sequence[Sample]] = (),
    told: Turned | None = None,
) -> Measured:
    """Return what samples say.

    Parameters
    ----------
    standing : sequence of sequences of Sample
        Of each car while it stood.
    turning : sequence of sequences of Sample
        Of each car that was `told` to turn.
    told : Turned, optional
        When and how fast; without it no delay is known.
    """
    position = heading = interval = 0.0
    for samples in standing:
        x, y = (np.array([getattr(sample, name) for sample in samples]) for name in ("x", "y"))
        turned = np.unwrap([sample.heading for sample in samples])
        position = max(position, float(np.abs(x - x.mean()).max()), float(np.abs(y - y.mean()).max()))
        heading = max(heading, float(np.abs(turned - turned.mean()).max()))
        interval = max(interval, float(np.diff([sample.time for sample in samples]).max(initial=0.0)))
    delays = [delay for samples in turning if told and (delay := delay_of(samples, told)) is not None]
    return Measured(max(delays, default=None), position, heading, interval)


def delay_of(samples: Sequence[Sample], told: Turned) -> float | None:
    """Return how late a car does what it was told, seconds, by least squares; None if it did not."""
    times: Floats = np.array([sample.time for sample in samples])
    turned: Floats = np.unwrap([sample.heading for sample in samples])
    turned -= turned.mean()
    best, late, gain = math.inf, 0.0, 0.0
    for delay in np.arange(0.0, LATEST, STEP).tolist():
        way = told.way(times - delay)
        way -= way.mean()
        size = float(way @ way)
        share = float(way @ turned) / size if size > 0.0 else 0.0
        left = float(((turned - share * way) ** 2).sum())
        if left < best:
            best, late, gain = left, delay, share
    return late if gain > 0.5 else None


class LagWatch:
    """Looks in a running trial whether commands take effect as late as is declared, by the speeds of the cars.

    Parameters
    ----------
    cars : int
        Number of cars.
    """

    def __init__(self, cars: int) -> None:
        self._sent: Floats = np.zeros((LAGS + 1, cars))
        self._errors: Floats = np.zeros((cars, LAGS + 1))
        self._moved: Any = np.zeros(cars, dtype=np.int64)
        self._tick = 0

    def add(self, commanded: Floats, seen: Floats) -> None:
        """Add a tick: the speeds that the cars were told, and the speeds seen in it, (N,), m/s."""
        self._sent = np.roll(self._sent, 1, axis=0)
        self._sent[0] = commanded
        self._tick += 1
        if self._tick > LAGS:
            self._errors += ((seen - self._sent) ** 2).T
            self._moved += np.ptp(self._sent, axis=0) > 0.0

    def lag(self, n: int) -> int | None:
        """Return how many ticks late the commands of car n take effect, None if that can't be told yet."""
        if self._moved[n] < WATCHED:
            return None
        errors = self._errors[n]
        lag = int(errors.argmin())
        others = np.delete(errors, range(max(0, lag - 2), min(LAGS, lag + 2) + 1))
        return lag if len(others) and errors[lag] < CLEAR * others.min() else None
