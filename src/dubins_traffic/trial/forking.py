"""Forks of a trial: deep copies of its parts, in which a reseeded instance may replace the trial's own."""

from __future__ import annotations

from copy import deepcopy
from typing import TYPE_CHECKING, Any, Final, TypeVar

from dubins_traffic.cars.state import NONE, Event
from dubins_traffic.errors import InputError

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

FORKED: Final = "fork"
"""Kind of the event in a fork that goes on from another seed."""

T = TypeVar("T")


def forked(value: T, before: Instance, after: Instance) -> T:
    """Return a deep copy of `value` for a fork, in which every reference to `before` has become one to `after`.

    Raises
    ------
    InputError
        If a part of `value` can't be copied, or refuses to be.
    """
    memo: dict[int, Any] = {id(before): after}
    try:
        return deepcopy(value, memo)
    except TypeError as error:
        raise InputError(
            "something in the trial can't be copied",
            field="fork",
            value=str(error),
            expected="controllers, metrics and sinks that copy.deepcopy takes",
        ) from error


def reseeded(tick: int, seed: int) -> Event:
    """Return the event that notes, in a fork's record, the tick from which it draws from another seed."""
    return Event(tick, FORKED, NONE, f"from here on all is drawn from seed {seed}")
