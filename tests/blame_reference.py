"""Whose breaches count among several learners, a slow reference: `envs.blame`, written with Python's own lists."""

from __future__ import annotations

import math
from collections.abc import Sequence

from dubins_traffic.cars.state import EGO
from dubins_traffic.envs.blame import EXCUSED_FOR, WINDOW
from dubins_traffic.problem.instance import Problem
from dubins_traffic.rules.exceptions import Exceptions
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.referee import Breach, order
from dubins_traffic.scoring.verdict import assumed, assumption_of


class Blame:
    """Decides for the breaches of one trial, as they come, which count.

    - A breach by an e-agent counts if the problem assumes the part of E1 to E6 that it breaks, if it is beyond the
      exceptions that are allowed, and if no breach by the ego has counted in an earlier frame.
    - A breach by the ego counts if no breach by an e-agent has counted, up to and including its frame.

    All others are excused. With a window only what has counted in so many seconds before excuses.

    Parameters
    ----------
    excuses : bool, str or float
        Whether what has counted of one side's excuses the other for the rest of the trial; or the window, seconds;
        `WINDOW` is one of `EXCUSED_FOR`. False: each side answers for all that it breaks.

    Attributes
    ----------
    first : int or None
        The car whose breach was the first that counted; None so far.

    Raises
    ------
    InputError
        If `excuses` is none of these.
    """

    def __init__(self, problem: Problem, *, excuses: bool | str | float = True) -> None:
        known: dict[object, float] = {WINDOW: EXCUSED_FOR, True: math.inf, False: 0.0}
        self._window = known[excuses] * problem.rate if excuses in known else float(excuses) * problem.rate
        rules = RuleParameters.from_mapping(problem.rules)
        self._assumed = assumed(rules)
        self._exceptions = Exceptions(rules, problem.rate)
        self._last = dict.fromkeys((True, False), -math.inf)
        self.first: int | None = None

    def of(self, breaches: Sequence[Breach]) -> list[tuple[Breach, str]]:
        """Return the breaches since the last call that count, each with the part that it breaks.

        That is ``E1`` to ``E6`` of an e-agent's, and the rule itself of the ego's.
        """
        counted: list[tuple[Breach, str]] = []
        for breach in sorted(breaches, key=lambda one: (one.tick, one.car == EGO, *order(one))):
            part = breach.rule if breach.car == EGO else assumption_of(breach.rule)
            if self._counts(breach, part):
                counted.append((breach, part))
                self._last[breach.car == EGO] = breach.tick
                self.first = breach.car if self.first is None else self.first
        return counted

    def _is_excused(self, tick: int, *, ego: bool) -> bool:
        since = tick - self._last[not ego]
        soon = self._window > 0.0 and since <= self._window and since < math.inf
        return soon and since >= (0 if ego else 1)

    def _counts(self, breach: Breach, part: str) -> bool:
        if breach.car == EGO:
            return not self._is_excused(breach.tick, ego=True)
        allowed = part == "E1" and not self._exceptions.exceeded(breach)
        return part in self._assumed and not allowed and not self._is_excused(breach.tick, ego=False)
