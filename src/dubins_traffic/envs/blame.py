"""Decides which breaches count against a car, and which are excused since another car broke its part first.

The rules are an agreement: the e-agents keep E1 to E6, and the ego then keeps rules 1 to 3 (docs/rules.md). Within a
frame the e-agents move first, as in a verdict.
"""

from __future__ import annotations

from collections.abc import Sequence

from dubins_traffic.cars.state import EGO
from dubins_traffic.problem.instance import Problem
from dubins_traffic.rules.exceptions import Exceptions
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.referee import Breach, order
from dubins_traffic.scoring.verdict import assumed, assumption_of


class Blame:
    """Decides for the breaches of one trial, as they come, which count.

    - A breach by an e-agent counts if the problem assumes the part of E1 to E6 that it breaks, if it is beyond the
      exceptions that are allowed, and if the ego has not violated its own part in an earlier frame.
    - A breach by the ego counts if no breach by an e-agent has counted, up to and including its frame.

    All others are excused.

    Parameters
    ----------
    problem : Problem
        What is judged.
    excuses : bool
        Whether it matters who broke first; else each side answers for all that it breaks.

    Attributes
    ----------
    first : int or None
        The car whose breach was the first that counted; None so far.
    """

    def __init__(self, problem: Problem, *, excuses: bool = True) -> None:
        self._excuses = excuses
        rules = RuleParameters.from_mapping(problem.rules)
        self._assumed = assumed(rules)
        self._exceptions = Exceptions(rules, problem.rate)
        self._since = -1
        self.first: int | None = None

    def of(self, breaches: Sequence[Breach]) -> list[tuple[Breach, str]]:
        """Return the breaches since the last call that count, each with the part that it breaks.

        That is ``E1`` to ``E6`` of an e-agent's, and the rule itself of the ego's.
        """
        found: list[tuple[Breach, str]] = []
        for breach in sorted(breaches, key=lambda one: (one.tick, one.car == EGO, *order(one))):
            part = breach.rule if breach.car == EGO else assumption_of(breach.rule)
            if self._counts(breach, part):
                found.append((breach, part))
                if self.first is None:
                    self.first, self._since = breach.car, breach.tick
        return found

    def _counts(self, breach: Breach, part: str) -> bool:
        if breach.car == EGO:
            return self.first in (None, EGO) or not self._excuses
        allowed = part == "E1" and not self._exceptions.exceeded(breach)
        excused = self._excuses and self.first == EGO and self._since < breach.tick
        return part in self._assumed and not allowed and not excused
