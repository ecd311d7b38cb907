"""Actions of an environment, and the commands that they stand for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
from gymnasium import spaces

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats

if TYPE_CHECKING:
    from dubins_traffic.cars.body import Bounds

SPEEDS: Final = (0.0, 0.5, 1.0)
"""Speeds of discrete actions, as shares of the top speed."""
TURNS: Final = (-1.0, -0.25, 0.0, 0.25, 1.0)
"""Yaw rates of discrete actions, as shares of the top yaw rate; action ``5 j + k`` is speed j and turn k."""


class ActionMap:
    """What actions stand for.

    Parameters
    ----------
    kind : str
        ``continuous``: two numbers from -1 to 1, speed and yaw rate, scaled to the car's bounds. ``discrete``: one of
        the pairs of `SPEEDS` and `TURNS`.
    bounds : Bounds
        The car's.

    Attributes
    ----------
    space : gymnasium.spaces.Space
        The actions of one environment.
    """

    space: spaces.Box | spaces.Discrete

    def __init__(self, kind: str, bounds: Bounds) -> None:
        low = -bounds.speed if bounds.speed_min is None else bounds.speed_min
        self._middle, self._half = 0.5 * (bounds.speed + low), 0.5 * (bounds.speed - low)
        self._yaw_rate = bounds.yaw_rate
        self._table: Floats | None = None
        if kind == "continuous":
            self.space = spaces.Box(-1.0, 1.0, (2,), np.float32)
        elif kind == "discrete":
            pairs = [
                (max(low, speed * bounds.speed), turn * bounds.yaw_rate) for speed in SPEEDS for turn in TURNS
            ]
            self._table = np.array(pairs)
            self.space = spaces.Discrete(len(pairs))
        else:
            raise InputError("no such actions", field="action", value=kind, expected="continuous or discrete")

    def commands(self, actions: Any) -> Floats:
        """Return the commands, (K, 2), speed in m/s and yaw rate in rad/s, of the actions of K environments or steps.

        Raises
        ------
        InputError
            If they are no actions.
        """
        if self._table is not None:
            chosen = np.asarray(actions)
            if chosen.ndim != 1 or not np.issubdtype(chosen.dtype, np.integer):
                raise _no_action(actions, "an integer each")
            if len(chosen) and not (chosen.min() >= 0 and chosen.max() < len(self._table)):
                raise _no_action(actions, f"from 0 to {len(self._table) - 1}")
            return self._table[chosen]
        asked = np.array(actions, dtype=np.float64)
        if asked.ndim != 2 or asked.shape[1] != 2 or not np.isfinite(asked).all():
            raise _no_action(actions, "two finite numbers each")
        np.clip(asked, -1.0, 1.0, out=asked)
        asked[:, 0] *= self._half
        asked[:, 0] += self._middle
        asked[:, 1] *= self._yaw_rate
        return asked


def _no_action(actions: object, expected: str) -> InputError:
    return InputError("not an action", field="action", value=actions, expected=expected)
