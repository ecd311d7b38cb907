"""Directions of the arms of a junction, turned as little as needed so that no two are too near each other."""

from __future__ import annotations

from math import pi

MOST_TURNED = 0.5
"""An arm may be turned by at most this, radians."""
_ROUNDS = 400


def spread(bearings: list[float], least: float) -> list[float] | None:
    """Return bearings that are at least `least` radians apart, near the given ones; None if none are near enough.

    Two neighbours that are too near are turned away from each other by the same amount, again and again.

    Parameters
    ----------
    bearings : list of float
        Of the arms, radians, in any order.
    least : float
        Least angle between two of them.
    """
    if len(bearings) * least > 2.0 * pi:
        return None
    order = sorted(range(len(bearings)), key=lambda k: bearings[k] % (2.0 * pi))
    now = [bearings[k] % (2.0 * pi) for k in order]
    for _ in range(_ROUNDS):
        worst = 0.0
        for k in range(len(now)):
            following = (k + 1) % len(now)
            gap = now[following] - now[k] + (2.0 * pi if following <= k else 0.0)
            lack = least - gap
            if lack > 0.0 and following != k:
                now[k] -= 0.5 * lack
                now[following] += 0.5 * lack
                worst = max(worst, lack)
        if worst < 1e-6:
            break
    else:
        return None
    made = list(bearings)
    for k, bearing in zip(order, now, strict=True):
        change = (bearing - bearings[k] + pi) % (2.0 * pi) - pi
        if abs(change) > MOST_TURNED:
            return None
        made[k] = bearings[k] + change
    return made
