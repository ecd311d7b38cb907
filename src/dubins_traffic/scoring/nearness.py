"""Whether each breach of the ego followed one by an e-agent near it (docs/rules.md#near)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import groupby
from typing import TYPE_CHECKING

from dubins_traffic.cars.state import EGO

if TYPE_CHECKING:
    from dubins_traffic.rules.referee import Breach


def is_near(breaches: Sequence[Breach], back: int, seen: Callable[[int, int], bool]) -> bool:
    """Tell whether each breach of the ego follows one of an e-agent that was near it.

    Norm: docs/rules.md#near.

    Parameters
    ----------
    breaches
        All breaches of a trial, in order of time.
    back
        Most ticks from the e-agent's breach to the ego's; the same frame counts.
    seen
        Called with (car, tick) of a breach by an e-agent; tells whether the car was within the sensing radius then.
    """
    last: int | None = None
    for tick, group in groupby(breaches, key=lambda breach: breach.tick):
        cars = {breach.car for breach in group}
        if any(car != EGO and seen(car, tick) for car in cars):
            last = tick
        if EGO in cars and (last is None or last < tick - back):
            return False
    return True
