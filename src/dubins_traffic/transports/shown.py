"""What transports show: states between frames, where that is more often than once a tick, and what cars see."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from dubins_traffic.cars.state import EGO, Labels, Observation, State
from dubins_traffic.observations.senses import Senses

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

SIGHT = 1e150
"""Sensing radius of remote e-agents, metres: they see everything."""


def kept(state: State, labels: Labels) -> tuple[State, Labels]:
    """Return copies of arrays that belong to others and change with the next tick."""
    return State(*(column.copy() for column in state)), Labels(*(row.copy() for row in labels))


def between(before: State, after: State, share: float) -> State:
    """Return the state at `share` (0 to 1) of the way from one frame to the next.

    Within a tick of 1/30 s the chord of a car's arc is less than 0.1 mm from it.
    """
    x, y, c, s = (
        first + share * (last - first)
        for first, last in (
            (before.x, after.x),
            (before.y, after.y),
            (before.c, after.c),
            (before.s, after.s),
        )
    )
    length = np.hypot(c, s)
    return State(x, y, c / length, s / length, after.speed, after.yaw_rate, after.count)


def onward(before: State, seconds: float) -> State:
    """Return where the cars are `seconds` after a frame if they go on as they are."""
    if seconds <= 0.0:
        return before
    way, turn = before.speed * seconds, before.yaw_rate * seconds
    cosine, sine = np.cos(turn), np.sin(turn)
    c, s = before.c * cosine - before.s * sine, before.s * cosine + before.c * sine
    half_c, half_s = before.c + c, before.s + s
    length = np.hypot(half_c, half_s)
    x, y = before.x + way * half_c / length, before.y + way * half_s / length
    return State(x, y, c, s, before.speed, before.yaw_rate, before.count)


class Sights:
    """What each car of one trial sees.

    Parameters
    ----------
    instance : Instance
        The instance of the trial.
    """

    def __init__(self, instance: Instance) -> None:
        self._instance = instance
        self._senses: dict[int, Senses] = {}

    def take(self, tick: int, state: State, labels: Labels, own: Callable[[], Observation]) -> None:
        """Take the next frame; `own` returns the ego's observation of it."""
        self._tick, self._state, self._labels, self._own = tick, state, labels, own
        self._seen: dict[int, Observation] = {}

    def observe(self, car: int) -> Observation:
        """Return the observation of `car` in the present frame; the ego's is the trial's own."""
        if car == EGO:
            return self._own()
        if car not in self._seen:
            self._seen[car] = self.sense(car, self._state)
        return self._seen[car]

    def sense(self, car: int, state: State) -> Observation:
        """Return what `car` sees in `state`, which lies between the present frame and the next."""
        if car not in self._senses:
            self._senses[car] = Senses(self._instance, car, None if car == EGO else SIGHT)
        return self._senses[car].observe(self._tick, state, self._labels)
