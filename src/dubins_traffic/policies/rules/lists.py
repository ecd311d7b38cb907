"""Lists of the cars of a trial by segment, for cars that look around (compiled)."""

from __future__ import annotations

from typing import Final, NamedTuple

from dubins_traffic.cars.sensing import within_sight
from dubins_traffic.kernels.compile import jit_inline
from dubins_traffic.policies.rules.tables import Traffic


class _Listed(NamedTuple):
    """Which cars are in the lists of the segments."""

    NOBODY: int = 0
    SEEN: int = 1
    """All whom the ego sees."""
    ALL: int = 2


LISTED: Final = _Listed()


@jit_inline
def enlist(b: int, n: int, sight2: float, traffic: Traffic) -> None:
    """Fill the lists of the segments with the cars that car n takes into account: all, or those that the ego sees.

    `sight2` (m^2) is the square of how far the ego sees, negative if that is everywhere.
    """
    scratch = traffic.scratch
    if n > 0 and scratch.listed[0] == LISTED.SEEN:
        unlist_cars(b, traffic)
        scratch.listed[0] = LISTED.NOBODY
    if scratch.listed[0] == LISTED.NOBODY:
        hidden = list_cars(b, sight2 if n == 0 else -1.0, traffic)
        scratch.listed[0] = LISTED.SEEN if hidden > 0 else LISTED.ALL


@jit_inline
def list_cars(b: int, sight2: float, traffic: Traffic) -> int:
    """Enter the cars that the ego sees, by `sight2` (m^2; all if negative), in the lists of their segments.

    Returns how many it does not see.
    """
    state, labels, scratch = traffic.state, traffic.labels, traffic.scratch
    hidden = 0
    for n in range(state.count[b]):
        dx = state.x[b, n] - state.x[b, 0]
        dy = state.y[b, n] - state.y[b, 0]
        if not within_sight(dx, dy, sight2):
            hidden += 1
            continue
        scratch.link[n] = scratch.head[labels.segment[b, n]]
        scratch.head[labels.segment[b, n]] = n
    return hidden


@jit_inline
def unlist_cars(b: int, traffic: Traffic) -> None:
    """Empty the lists of the segments on which there are cars."""
    state, labels, scratch = traffic.state, traffic.labels, traffic.scratch
    for n in range(state.count[b]):
        scratch.head[labels.segment[b, n]] = -1
