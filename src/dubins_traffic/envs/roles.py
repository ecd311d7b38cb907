"""Rewards of the cars of a trial by role: ego, adversaries that spoil its task, peers with tasks of their own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from dubins_traffic.cars.state import EGO
from dubins_traffic.envs import terms
from dubins_traffic.envs.crew import PARTS, Crew
from dubins_traffic.envs.terms import COSTS, TERM, TERMS
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.scoring.verdict import ASSUMPTIONS

ADVERSARY: Final[Mapping[str, float]] = {
    "spoiled": 1.0,
    "violated": 1.0,
    "comfort": 0.0,
    "time": 0.0,
    **dict.fromkeys(ASSUMPTIONS, -1.0),
    "E2": -5.0,
}
"""Default weights of the terms of an adversary's reward.

`spoiled`: what the ego's visits, rounds and progress count for it, with the sign turned; `violated`: breaches of the
ego's that count; and its own breaches that count, by the part of the assumption.
"""
PEER: Final[Mapping[str, float]] = {
    **{name: terms.WEIGHTS[name] for name in TERMS[: TERM.BREACHES]},
    **dict.fromkeys(ASSUMPTIONS, -1.0),
    "E2": -5.0,
}
"""Default weights of the terms of a peer's reward; a peer goes round the goals as the ego does."""
ROLES: Final[Mapping[str, Mapping[str, float]]] = {"adversaries": ADVERSARY, "peers": PEER}
"""The roles of e-agents."""
_FIRST: Final = len(COSTS)
"""The first of `PARTS` that an e-agent may break."""


class Pay:
    """Computes the reward of each car of a crew in a step.

    Parameters
    ----------
    role : str
        What e-agents are: ``adversaries`` or ``peers``.
    reward : mapping, optional
        Weights of terms that are not as usual: under ``ego`` those of the ego, under ``others`` those of e-agents.

    Raises
    ------
    InputError
        If there is no such role, or no such term, or a weight is no finite number.
    """

    def __init__(self, role: str, reward: Mapping[str, Mapping[str, float]] | None = None) -> None:
        if role not in ROLES:
            raise InputError("no such role", field="roles", value=role, expected=" or ".join(ROLES))
        given = dict(reward or {})
        unknown = given.keys() - {"ego", "others"}
        if unknown:
            raise InputError("not rewards", field="reward", value=sorted(unknown)[0], expected="ego, others")
        self._ego = terms.weights_of(given.get("ego"))
        self._others = _checked(ROLES[role], given.get("others", {}))
        self._spoils = role == "adversaries"

    def of(self, crew: Crew, b: int, car: int) -> tuple[float, dict[str, Any]]:
        """Return the reward of a car of trial b in the last step, and what it says of it: its terms, and costs."""
        if car == EGO:
            broken: Floats = crew.broken[b, EGO, :_FIRST].astype(np.float64)
            own = np.concatenate([crew.terms[b, EGO, : TERM.BREACHES], broken])
            weighted: list[float] = (own * self._ego).tolist()
            costs = dict(zip(COSTS, broken.tolist(), strict=True))
            return sum(weighted), {"reward_terms": dict(zip(TERMS, weighted, strict=True)), "cost": costs}
        parts = dict(zip(ASSUMPTIONS, map(float, crew.broken[b, car, _FIRST:]), strict=True))
        done: dict[str, float] = dict(
            zip(TERMS[: TERM.BREACHES], crew.terms[b, car, : TERM.BREACHES].tolist(), strict=True)
        )
        if self._spoils:
            done["spoiled"] = -self._task(crew, b)
            done["violated"] = float(crew.broken[b, EGO, : PARTS.index("at_fault")].sum())
        found = {name: weight * {**done, **parts}[name] for name, weight in self._others.items()}
        return sum(found.values()), {"reward_terms": found, "cost": parts}

    def _task(self, crew: Crew, b: int) -> float:
        """Return the part of the ego's reward from visits, rounds and progress."""
        return float(
            sum(crew.terms[b, EGO, k] * self._ego[k] for k in (TERM.VISITS, TERM.ROUNDS, TERM.PROGRESS))
        )


def _checked(usual: Mapping[str, float], given: Mapping[str, float]) -> dict[str, float]:
    for name, value in given.items():
        if name not in usual:
            raise InputError("no such term", field="reward.others", value=name, expected=", ".join(usual))
        if isinstance(value, bool) or not np.isfinite(value):
            raise InputError(
                "not a weight", field=f"reward.others.{name}", value=value, expected="a finite number"
            )
    return {**usual, **{name: float(value) for name, value in given.items()}}
