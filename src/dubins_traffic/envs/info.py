"""What a step tells beside its observation: terms of the reward, and costs by rule."""

from __future__ import annotations

from typing import Any

import numpy as np

from dubins_traffic.envs.terms import BREACHES, COSTS, TERMS
from dubins_traffic.kernels.arrays import Floats


def of_one(terms: Floats, weights: Floats) -> dict[str, Any]:
    """Return the info of a step of one environment, whose terms, (T,), are without weights."""
    weighted: list[float] = (terms * weights).tolist()
    costs: list[float] = terms[BREACHES:].tolist()
    return {
        "reward_terms": dict(zip(TERMS, weighted, strict=True)),
        "cost": dict(zip(COSTS, costs, strict=True)),
    }


class StepInfo:
    """Makes the info of steps of all environments.

    Parameters
    ----------
    envs : int
        How many there are.
    weights : (T,)
        Weights of the terms.
    """

    def __init__(self, envs: int, weights: Floats) -> None:
        self._weights = weights
        everyone = np.ones(envs, dtype=np.bool_)
        everyone.flags.writeable = False
        self._masks = {"_reward_terms": everyone, "_cost": everyone}
        self._of_terms = {f"_{name}": everyone for name in TERMS}
        self._of_costs = {f"_{name}": everyone for name in COSTS}

    def of_all(self, terms: Floats) -> dict[str, Any]:
        """Return the info of a step, whose terms, (E, T), are without weights: arrays (E,), with masks."""
        weighted, costs = (terms * self._weights).T, terms[:, BREACHES:].T.copy()
        return {
            "reward_terms": {**dict(zip(TERMS, weighted, strict=True)), **self._of_terms},
            "cost": {**dict(zip(COSTS, costs, strict=True)), **self._of_costs},
            **self._masks,
        }
