"""The info of a step: terms of the reward, and costs by rule."""

from __future__ import annotations

from typing import Any

import numpy as np

from dubins_traffic.envs.terms import COSTS, TERM, TERMS
from dubins_traffic.kernels.arrays import Floats

_TERMS = np.dtype([(name, np.float64) for name in TERMS])
_COSTS = np.dtype([(name, np.float64) for name in COSTS])


def of_one(terms: Floats, weighted: Floats) -> dict[str, Any]:
    """Return the info of a step of one environment, whose terms, (T,), are given without and with weights."""
    return {
        "reward_terms": dict(zip(TERMS, weighted.tolist(), strict=True)),
        "cost": dict(zip(COSTS, terms[TERM.BREACHES :].tolist(), strict=True)),
    }


class StepInfo:
    """Makes the info of steps of all environments.

    Parameters
    ----------
    envs : int
        How many there are.
    """

    def __init__(self, envs: int) -> None:
        everyone = np.ones(envs, dtype=np.bool_)
        everyone.flags.writeable = False
        self._masks = {"_reward_terms": everyone, "_cost": everyone}

    def of_all(self, terms: Floats, weighted: Floats) -> dict[str, Any]:
        """Return the info of a step, whose terms, (E, T), are given without and with weights.

        Of `reward_terms` and `cost` each is an array (E,) of rows whose fields have the names of the terms, so that
        ``info["cost"]["2.left"]`` is (E,).
        """
        return {
            "reward_terms": weighted.copy().view(_TERMS)[:, 0],
            "cost": terms[:, TERM.BREACHES :].copy().view(_COSTS)[:, 0],
            **self._masks,
        }
