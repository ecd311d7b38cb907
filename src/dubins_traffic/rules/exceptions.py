"""The breaches of E1 that an e-agent is allowed (docs/rules.md#exceptions)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dubins_traffic.rules.tables import ticks

if TYPE_CHECKING:
    from dubins_traffic.rules.parameters import RuleParameters
    from dubins_traffic.rules.referee import Breach


class Exceptions:
    """Counts the breaches of E1 (rules 1.road, 2 and 3) by the e-agents of one trial.

    Norm: docs/rules.md#exceptions.

    Parameters
    ----------
    rules : RuleParameters
        `exceptions` breaches of a car are allowed within `exception_time`.
    rate : float
        Control rate, Hz.
    """

    def __init__(self, rules: RuleParameters, rate: float) -> None:
        self._allowed = rules.exceptions
        self._window = ticks(rules.exception_time, rate)
        self._counted: dict[int, list[tuple[int, str]]] = {}

    def exceeded(self, breach: Breach) -> bool:
        """Count a breach; return whether its car has made more than it is allowed.

        Breaches come in the order of time. What one car does against one rule in one frame counts once.
        """
        counted = self._counted.get(breach.car, [])
        recent = [entry for entry in counted if breach.tick - entry[0] < self._window]
        entry = (breach.tick, breach.rule[0])
        self._counted[breach.car] = recent if entry in recent else [*recent, entry]
        return len(self._counted[breach.car]) > self._allowed
