"""States between two frames, for transports that show the world more often than once a tick."""

from __future__ import annotations

import numpy as np

from dubins_traffic.cars.state import Labels, State


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
