"""Spaces of observations, and observations in them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import spaces

from dubins_traffic.cars.state import Observation

if TYPE_CHECKING:
    import numpy.typing as npt

    from dubins_traffic.observations.flat import Layout


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
