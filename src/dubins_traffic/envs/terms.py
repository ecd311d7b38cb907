"""The reward of each car in a step: its terms and their weights by role, and costs by rule.

The ego's terms are counted, and those of environments of one ego summed up, by `envs.step_kernel`; e-agents are
adversaries, which spoil the ego's task, or peers with tasks of their own.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np

from dubins_traffic.cars.state import EGO
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.compile import jit_inline
from dubins_traffic.rules import breach_log
from dubins_traffic.rules.breach_log import RULE, RULES
from dubins_traffic.scoring.verdict import ASSUMPTIONS, EGO_RULES

COSTS: Final = (*EGO_RULES, "at_fault")
"""Costs, by number: breaches of each rule of the ego's, and its collisions at fault."""
AT_FAULT: Final = len(COSTS) - 1
COUNTED: Final = tuple(k for k, name in enumerate(COSTS) if name != RULES[RULE.COLLISION])
"""The costs whose sum is the one cost of a step: a collision counts once, where the ego is at fault."""
PARTS: Final = (*COSTS, *ASSUMPTIONS)
"""The parts that can be broken, by number: of the ego its rules and fault, of an e-agent E1 to E6."""


class _Term(NamedTuple):
    """The number of each term of the reward."""

    VISITS: int = 0
    ROUNDS: int = 1
    PROGRESS: int = 2
    COMFORT: int = 3
    TIME: int = 4
    EARLY: int = 5
    """Rounds before the first breach."""
    OFF_ROAD: int = 6
    """The first of the three terms of breaches that last."""
    LEFT: int = 7
    CROSSING: int = 8
    BREACHES: int = 9
    """The first of the terms that are costs, and, of several learners, of `PARTS`."""
    SPOILED: int = BREACHES + len(PARTS)
    VIOLATED: int = SPOILED + 1
    """The last two are those of adversaries alone."""


TERM: Final = _Term()
TERMS: Final = (
    "visits", "rounds", "progress", "comfort", "time", "rounds_before_breach", "off_road_s", "left_s", "crossing_s",
    *COSTS,
)  # fmt: skip
"""Terms of the reward, by number."""
LASTING: Final = TERMS[TERM.OFF_ROAD : TERM.BREACHES]
"""Those of breaches that last, seconds."""

WEIGHTS: Final[Mapping[str, float]] = {
    "visits": 1.0,
    "rounds": 0.0,
    "progress": 0.1,
    "comfort": -0.01,
    "time": 0.0,
    "rounds_before_breach": 0.0,
    **dict.fromkeys((*LASTING, *COSTS), 0.0),
}
"""Default weights of the terms.

`visits` of goals; `rounds` through all of them; `progress` toward the goal that is sought, metres along lanes;
`comfort`: sum over ticks of the squared changes of speed and yaw rate, as shares of the car's bounds; `time`, seconds;
`rounds_before_breach`: the rounds that a ranking counts before the ego's first breach; seconds off the road
(`off_road_s`), over the centre line without overtaking (`left_s`) and in a disc entered against rule 3 (`crossing_s`),
where the rules are judged; the ego's breaches by rule (rule 1's collisions whoever is at fault); `at_fault`: collisions
in which it is at fault.
"""
DEBT: Final = "debt"
"""The name under which a reward has the weight of `DEBTS`, 1 unless said otherwise."""
DEBTS: Final[Mapping[str, float]] = {
    **dict.fromkeys(LASTING, 0.2),
    **dict.fromkeys(COSTS, 1.0),
    RULES[RULE.COLLISION]: 0.0,
    "at_fault": 7.0,
}
"""What a unit of each term adds to the debt of a car: visits, rounds and progress are worth `worth` of it from then on.

So a breach never leaves a car with less than one has that stands still, and always with less than without it.
"""
LEAST: Final = 0.125
"""What they are worth at least."""
EARNED: Final = range(TERM.VISITS, TERM.PROGRESS + 1)
"""The terms of which that holds: visits, rounds and progress."""


@jit_inline
def worth(debt: float) -> float:
    """Return what the terms `EARNED` are worth with a `debt` (ratio), 1 to `LEAST`."""
    return max(LEAST, 1.0 / (1.0 + debt))


def cost_of(costs: Floats) -> Floats:
    """Return the one cost, (...), of rows of costs, (..., C): breaches of all rules, collisions where at fault."""
    return costs[..., COUNTED].sum(axis=-1)


def costs_of_rules() -> Ints:
    """Return the cost, by number, of each rule, by number, (R,); -1 of a rule that the ego can't break."""
    return np.array([EGO_RULES.index(rule) if rule in EGO_RULES else -1 for rule in breach_log.RULES])


SCORE: Final = "score"
"""The reward that sums to the rounds before the first breach of an episode, and has no other term."""


def weights_of(given: Mapping[str, float] | str | None) -> tuple[Floats, Floats]:
    """Return the weight of each term of the ego's, and its debts, each (T,).

    `given` names the weights that are not as in `WEIGHTS`, or is `SCORE`. InputError if it is anything else.
    """
    if given == SCORE:
        given = dict.fromkeys((*TERMS, DEBT), 0.0) | {TERMS[TERM.EARLY]: 1.0}
    if isinstance(given, str):
        raise InputError("no such reward", field="reward", value=given, expected=f"{SCORE}, or weights by term")
    weights = _weighted({**WEIGHTS, DEBT: 1.0}, given or {}, "reward")
    debts = [weights[DEBT] * DEBTS.get(name, 0.0) for name in TERMS]
    return np.array([weights[name] for name in TERMS]), np.array(debts)


def _weighted(usual: Mapping[str, float], given: Mapping[str, float], field: str) -> dict[str, float]:
    """Return the weights by term, in the order of `usual`; `field` names what is given."""
    weights = dict(usual)
    for name, value in given.items():
        if name not in weights:
            raise InputError("no such term", field=field, value=name, expected=", ".join(usual))
        if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise InputError("not a weight", field=f"{field}.{name}", value=value, expected="a finite number")
        weights[name] = float(value)
    return weights


ADVERSARY: Final[Mapping[str, float]] = {
    "spoiled": 1.0,
    "violated": 1.0,
    "comfort": 0.0,
    "time": 0.0,
    **dict.fromkeys(LASTING, -0.1),
    **dict.fromkeys(ASSUMPTIONS, -1.0),
    "E2": -5.0,
}
"""Default weights of the terms of an adversary's reward.

`spoiled`: what the ego's visits, rounds and progress count without debts, with the sign turned; `violated`: breaches of
the ego's that count; and its own breaches that count, by the part of the assumption.
"""
PEER: Final[Mapping[str, float]] = {
    **{name: WEIGHTS[name] for name in (*TERMS[: TERM.EARLY], *LASTING)},
    **dict.fromkeys(ASSUMPTIONS, 0.0),
}
"""Default weights of the terms of a peer's reward; a peer goes round the goals as the ego does."""
ROLES: Final[Mapping[str, Mapping[str, float]]] = {"adversaries": ADVERSARY, "peers": PEER}
"""The roles of e-agents."""
PEERS_DEBTS: Final[Mapping[str, float]] = {
    **{name: DEBTS[name] for name in LASTING},
    **dict.fromkeys(ASSUMPTIONS, 1.0),
    "E2": DEBTS["at_fault"],
}
"""What a unit of each term, or a breach of its part of the assumption, adds to the debt of a peer."""
PAID: Final = (*TERMS, *ASSUMPTIONS, "spoiled", "violated")
"""All that a car among several learners may be paid for, by number."""


class Pay:
    """The weights of all that is paid for, `PAID`, and what a unit of each adds to a debt, by role.

    Parameters
    ----------
    role : str
        What e-agents are: ``adversaries`` or ``peers``.
    reward : mapping, optional
        Weights of terms that are not as usual: under ``ego`` those of the ego, under ``others`` those of e-agents.

    Attributes
    ----------
    weights, debts : (2, T)
        Of the ego, and of e-agents.
    """

    def __init__(self, role: str, reward: Mapping[str, Mapping[str, float]] | None = None) -> None:
        if role not in ROLES:
            raise InputError("no such role", field="roles", value=role, expected=" or ".join(ROLES))
        given = dict(reward or {})
        unknown = given.keys() - {"ego", "others"}
        if unknown:
            raise InputError("not rewards", field="reward", value=sorted(unknown)[0], expected="ego, others")
        self.weights, self.debts = np.zeros((2, len(PAID))), np.zeros((2, len(PAID)))
        self.weights[0, : len(TERMS)], self.debts[0, : len(TERMS)] = weights_of(given.get("ego"))
        usual = ROLES[role] if role == "adversaries" else {**ROLES[role], DEBT: 1.0}
        others = _weighted(usual, given.get("others", {}), "reward.others")
        owed = others.pop(DEBT, 0.0)
        self._terms = TERMS, tuple(others)
        for k, name in enumerate(PAID):
            self.weights[1, k] = others.get(name, 0.0)
            self.debts[1, k] = owed * PEERS_DEBTS.get(name, 0.0)

    def tell(self, car: int, terms: Floats, weighted: Floats) -> dict[str, Any]:
        """Return what the info of a step says of a car: its terms with their weights, its costs, and their sum.

        `terms` (T,) are all of `PAID`, `weighted` (T,) the same with weights.
        """
        names, counted = (_OF_EGO, _COUNTED) if car == EGO else (_OF_OTHERS, _OF_OTHERS)
        done, broken = weighted.tolist(), terms.tolist()
        return {
            "reward_terms": {name: done[_PLACES[name]] for name in self._terms[min(car, 1)]},
            "cost": float(sum([broken[k] for k in counted])),
            "costs": {PAID[k]: broken[k] for k in names},
        }


_PLACES: Final = {name: k for k, name in enumerate(PAID)}
_OF_EGO: Final = range(TERM.BREACHES, len(TERMS))
_OF_OTHERS: Final = range(len(TERMS), len(TERMS) + len(ASSUMPTIONS))
_COUNTED: Final = tuple(TERM.BREACHES + k for k in COUNTED)


def costs_of(terms: Floats, *, ego: bool) -> Floats:
    """Return the one cost of rows of `PAID`, (..., T), of an ego or of an e-agent, (...)."""
    return terms[..., list(_COUNTED if ego else _OF_OTHERS)].sum(axis=-1)
