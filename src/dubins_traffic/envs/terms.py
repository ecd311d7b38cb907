"""The terms of rewards, with weights, and costs by rule."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.rules import breach_log
from dubins_traffic.scoring.verdict import EGO_RULES

COSTS: Final = (*EGO_RULES, "at_fault")
"""Costs, by number: breaches of each rule of the ego's, and its collisions at fault."""
AT_FAULT: Final = len(COSTS) - 1


class _Term(NamedTuple):
    """The number of each term of the reward."""

    VISITS: int = 0
    ROUNDS: int = 1
    PROGRESS: int = 2
    COMFORT: int = 3
    TIME: int = 4
    BREACHES: int = 5
    """The first of the terms that are costs."""


TERM: Final = _Term()
TERMS: Final = ("visits", "rounds", "progress", "comfort", "time", *COSTS)
"""Terms of the reward, by number."""

WEIGHTS: Final[Mapping[str, float]] = {
    "visits": 1.0,
    "rounds": 0.0,
    "progress": 0.1,
    "comfort": -0.01,
    "time": 0.0,
    **dict.fromkeys(COSTS, -1.0),
    "at_fault": -5.0,
}
"""Default weights of the terms.

`visits` of goals; `rounds` through all of them; `progress` toward the goal that is sought, metres along lanes;
`comfort`: sum over ticks of the squared changes of speed and yaw rate, as shares of the car's bounds; `time`, seconds;
the ego's breaches by rule (rule 1's collisions whoever is at fault); `at_fault`: collisions in which it is at fault.
"""


def costs_of_rules() -> Ints:
    """Return the cost, by number, of each rule, by number, (R,); -1 of a rule that the ego can't break."""
    return np.array([EGO_RULES.index(rule) if rule in EGO_RULES else -1 for rule in breach_log.RULES])


def weights_of(given: Mapping[str, float] | None) -> Floats:
    """Return the weight of each term, (T,), where `given` names those that are not as in `WEIGHTS`.

    Raises
    ------
    InputError
        If there is no such term, or a weight is no finite number.
    """
    own = dict(WEIGHTS)
    for name, value in (given or {}).items():
        if name not in own:
            raise InputError("no such term", field="reward", value=name, expected=", ".join(TERMS))
        if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise InputError("not a weight", field=f"reward.{name}", value=value, expected="a finite number")
        own[name] = float(value)
    return np.array([own[name] for name in TERMS])
