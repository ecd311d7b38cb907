"""Spaces of observations, observations in them, and the info of steps: terms of the reward, and costs by rule."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import spaces

from dubins_traffic.cars.state import Observation
from dubins_traffic.envs.terms import COSTS, TERM, TERMS, cost_of
from dubins_traffic.kernels.arrays import Floats

if TYPE_CHECKING:
    import numpy.typing as npt

    from dubins_traffic.learning.flat import Layout


class ObservationSpace(spaces.Space[Observation]):
    """The space of `cars.state.Observation`; nothing can be sampled from it."""

    def __init__(self) -> None:
        super().__init__()

    @property
    def is_np_flattenable(self) -> bool:
        """Whether its elements can be made vectors by Gymnasium: no."""
        return False

    def sample(self, mask: Any = None, probability: Any = None) -> Observation:
        """Refuse: there is no observation without a trial."""
        raise NotImplementedError("observations come of trials")

    def contains(self, x: Any) -> bool:
        """Tell whether something is an observation."""
        return isinstance(x, Observation)


def space_of(kind: str, layout: Layout) -> spaces.Space[Any]:
    """Return the space of observations of a kind (`envs.settings.OBSERVATIONS`)."""
    if kind == "object":
        return ObservationSpace()
    if kind == "flat":
        return _box(layout.size)
    return spaces.Dict({name: _box(part.stop - part.start) for name, part in layout.parts.items()})


def observed(kind: str, layout: Layout, flat: npt.NDArray[np.float32]) -> Any:
    """Return flat observations, (..., F), as those of a kind; they share nothing with the array."""
    if kind == "flat":
        return flat.copy()
    return {name: flat[..., part].copy() for name, part in layout.parts.items()}


def _box(size: int) -> spaces.Box:
    return spaces.Box(-1.0, 1.0, (size,), np.float32)


_TERMS = np.dtype([(name, np.float64) for name in TERMS])
_COSTS = np.dtype([(name, np.float64) for name in COSTS])


def info_of_one(terms: Floats, weighted: Floats) -> dict[str, Any]:
    """Return the info of a step of one environment, whose terms, (T,), are given without and with weights."""
    costs = terms[TERM.BREACHES :]
    return {
        "reward_terms": dict(zip(TERMS, weighted.tolist(), strict=True)),
        "cost": float(cost_of(costs)),
        "costs": dict(zip(COSTS, costs.tolist(), strict=True)),
    }


class StepInfo:
    """Makes the info of steps of all environments."""

    def __init__(self, envs: int) -> None:
        everyone = np.ones(envs, dtype=np.bool_)
        everyone.flags.writeable = False
        self._masks = {"_reward_terms": everyone, "_cost": everyone, "_costs": everyone}

    def of_all(self, terms: Floats, weighted: Floats) -> dict[str, Any]:
        """Return the info of a step, whose terms, (E, T), are given without and with weights.

        `cost` is (E,). Of `reward_terms` and `costs` each is an array (E,) of rows whose fields have the names of the
        terms, so that ``info["costs"]["2.left"]`` is (E,).
        """
        costs = terms[:, TERM.BREACHES :].copy()
        return {
            "reward_terms": weighted.copy().view(_TERMS)[:, 0],
            "cost": cost_of(costs),
            "costs": costs.view(_COSTS)[:, 0],
            **self._masks,
        }
