"""What a fork of a trial is made of: deep copies, in which another instance may stand for that of the trial."""

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
    """Return a deep copy of something that goes on in a fork, with the instance `after` wherever it has `before`.

    Raises
    ------
    InputError
        If something in it can't be copied, or says that it can't go on twice.
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
    """Return the event that tells of a fork since when it follows from another seed."""
    return Event(tick, FORKED, NONE, f"from here on all is drawn from seed {seed}")
