"""For how long a car has stood, waited for its turn, been first in the order and been left (compiled)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from dubins_traffic.cars.state import EGO, Labels, State
from dubins_traffic.kernels.compile import jit_inline
from dubins_traffic.kernels.records import Rows, record, table
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.propositions import FLAG

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Problem

LONG = 10.0
"""Seconds of standing or waiting that are shown as 1/2."""


@record
class Clock:
    """The clocks of the ego of one trial: each counts the frames in a row in which something holds."""

    standing: int
    """It is slower than the still speed."""
    waiting: int
    """It has stopped, and holds a ticket."""
    first: int
    """It is first in the order at a clear crossing."""
    left: int
    """It is left, and nobody hems it in."""
    still: float
    """The still speed, m/s."""
    long: float
    """`LONG`, ticks."""
    forfeit: float
    """How long it may be first at a clear crossing before it forfeits its turn, ticks."""
    back: float
    """How long it may be left, ticks."""


def clocks(problems: Sequence[Problem]) -> Rows[Clock]:
    """Return the clocks of some trials before their first frames."""
    rows = table(Clock, len(problems))
    rules = [RuleParameters.from_mapping(problem.rules) for problem in problems]
    rates = np.array([problem.rate for problem in problems])
    rows["still"] = [rule.still_speed for rule in rules]
    rows["long"] = LONG * rates
    rows["forfeit"] = np.array([rule.forfeit_time for rule in rules]) * rates
    rows["back"] = np.array([rule.left_time for rule in rules]) * rates
    return rows


@jit_inline
def keep_time(b: int, clock: Clock, state: State, labels: Labels) -> None:
    """Take note of a labelled frame of trial b. Call it once per frame."""
    bits = np.int64(labels.bits[b, EGO])
    stands, first = abs(state.speed[b, EGO]) < clock.still, FLAG.FIRST | FLAG.CLEAR
    clock.standing = clock.standing + 1 if stands else 0
    clock.waiting = clock.waiting + 1 if bits & FLAG.STOPPED != 0 else 0
    clock.first = clock.first + 1 if bits & first == first else 0
    clock.left = clock.left + 1 if bits & (FLAG.LEFT | FLAG.HEMMED) == FLAG.LEFT else 0


@jit_inline
def write_clocks(clock: Clock, out: npt.NDArray[np.float32]) -> None:
    """Write what the clocks show into `out` (4,), each from 0 to 1: the third is what is left before a forfeit."""
    out[0] = 1.0 - clock.long / (clock.standing + clock.long) if clock.standing > 0 else 0.0
    out[1] = 1.0 - clock.long / (clock.waiting + clock.long) if clock.waiting > 0 else 0.0
    out[2] = max(0.0, 1.0 - clock.first / clock.forfeit) if clock.first > 0 else 0.0
    out[3] = min(1.0, clock.left / clock.back) if clock.left > 0 else 0.0
