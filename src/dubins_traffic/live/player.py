"""A person who drives the ego: the controller that does what keys, a pad or a finger on a page ask for."""

from __future__ import annotations

from threading import Condition
from time import monotonic
from typing import Any, Final

from dubins_traffic.cars.state import Command, Observation
from dubins_traffic.problem.instance import Problem

ACCELERATION: Final = 1.4
"""Change of speed in a second, m/s, toward what is asked for."""
BRAKING: Final = 2.8
"""The same where the car is to become slower, m/s."""
TURNING: Final = 12.0
"""Change of the yaw rate in a second, rad/s."""
YAW_RATE: Final = 1.8
"""Yaw rate of a wheel turned all the way, rad/s, if the car may turn so fast."""
PATIENCE: Final = 3.0
"""Seconds for which a player whose page is gone may come back, as one does who loads it again."""


class LeftError(KeyboardInterrupt):
    """The player has closed the page: the trial ends as interrupted."""


class Wheel:
    """What the player's page asks for; there is one player, and whoever comes later looks on.

    Its methods are called from the thread of the pages and from that of the trial.

    Attributes
    ----------
    left : bool
        Whether the player has left for good.
    """

    def __init__(self) -> None:
        self.left = False
        self._changed = Condition()
        self._player: str | None = None
        self._pages = 0
        self._gone: float | None = None
        self._throttle = self._steer = 0.0
        self._started = self._gave_up = False

    def take(self, who: str) -> bool:
        """Let a page at the wheel if nobody is there, or if it has been there before."""
        with self._changed:
            if self._player not in (None, who):
                return False
            self._player = who
            self._pages += 1
            self._gone = None
            self._changed.notify_all()
            return True

    def leave(self, who: str) -> None:
        """Note that a page of the player's has gone."""
        with self._changed:
            if who == self._player:
                self._pages -= 1
                if not self._pages:
                    self._gone = monotonic()
                    self._throttle = self._steer = 0.0
                self._changed.notify_all()

    def hear(self, message: Any) -> None:
        """Do what the player's page asks for: drive, or give up.

        Raises
        ------
        ValueError
            If the message is neither.
        """
        match message:
            case {"give_up": True} if len(message) == 1:
                with self._changed:
                    self._gave_up = self._started = True
                    self._changed.notify_all()
            case {"drive": [int() | float() as throttle, int() | float() as steer]} if len(message) == 1:
                if not (-1.0 <= throttle <= 1.0 and -1.0 <= steer <= 1.0):
                    raise ValueError("neither throttle nor wheel goes beyond 1")
                with self._changed:
                    self._throttle, self._steer = float(throttle), float(steer)
                    self._started = self._started or bool(throttle or steer)
                    self._changed.notify_all()
            case _:
                raise ValueError("neither to drive nor to give up")

    def wait(self) -> None:
        """Return when the player has begun to drive.

        Raises
        ------
        LeftError
            If the player left before.
        """
        with self._changed:
            while not self._started:
                self._changed.wait(self._rest())

    def asked(self) -> tuple[float, float] | None:
        """Return throttle and wheel, both from -1 to 1; None if the player gives up.

        While the player's page is gone, it waits for it.

        Raises
        ------
        LeftError
            If it does not come back.
        """
        with self._changed:
            while self._gone is not None:
                self._changed.wait(self._rest())
            return None if self._gave_up else (self._throttle, self._steer)

    def _rest(self) -> float | None:
        """Return how long the player may still be away, None while there is no hurry; LeftError if he has left."""
        if self._gone is None:
            return None
        rest = self._gone + PATIENCE - monotonic()
        if rest <= 0.0:
            self.left = True
            raise LeftError
        return rest


class Player:
    """The controller of a person: speed and yaw rate follow throttle and wheel, and go back to 0 without.

    Parameters
    ----------
    wheel : Wheel
        Says what the person asks for.
    """

    def __init__(self, wheel: Wheel) -> None:
        self._wheel = wheel

    def start(self, problem: Problem) -> None:
        """Learn what the car can do."""
        self._bounds, self._period = problem.car.bounds, problem.period
        self._speed = self._yaw_rate = 0.0

    def act(self, observation: Observation) -> Command | None:  # noqa: ARG002  # the person looks at the page
        """Return the command that comes nearest to what is asked for."""
        asked = self._wheel.asked()
        if asked is None:
            return None
        throttle, steer = asked
        bounds = self._bounds
        wanted = throttle * (bounds.speed if throttle > 0.0 else max(0.0, -bounds.speed_low))
        slower = abs(wanted) < abs(self._speed) or wanted * self._speed < 0.0
        self._speed = _toward(self._speed, wanted, (BRAKING if slower else ACCELERATION) * self._period)
        turn = steer * min(YAW_RATE, bounds.yaw_rate)
        self._yaw_rate = _toward(self._yaw_rate, turn, TURNING * self._period)
        return Command(max(bounds.speed_low, min(self._speed, bounds.speed)), self._yaw_rate)


def _toward(value: float, wanted: float, most: float) -> float:
    """Return `value` changed toward `wanted` by at most `most`."""
    return value + max(-most, min(wanted - value, most))
