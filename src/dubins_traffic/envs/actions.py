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
"""Speeds of discrete actions: from the middle of the car's range (0 where it may reverse) to its top speed."""
TURNS: Final = (-1.0, -0.25, 0.0, 0.25, 1.0)
"""Yaw rates of discrete actions, as shares of the top yaw rate; action ``5 j + k`` is speed j and turn k."""


class ActionMap:
    """The table of the commands that actions stand for.

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
    middle, half : (2,)
        Speed and yaw rate in the middle of their ranges, and from there to the bounds, m/s and rad/s.
    """

    space: spaces.Box | spaces.Discrete

    def __init__(self, kind: str, bounds: Bounds) -> None:
        low = -bounds.speed if bounds.speed_min is None else bounds.speed_min
        self.middle = np.array([0.5 * (bounds.speed + low), 0.0])
        self.half = np.array([0.5 * (bounds.speed - low), bounds.yaw_rate])
        self._table: Floats | None = None
        if kind == "continuous":
            self.space = spaces.Box(-1.0, 1.0, (2,), np.float32)
        elif kind == "discrete":
            pairs = [(speed, turn) for speed in SPEEDS for turn in TURNS]
            self._table = np.array(pairs)
            self.space = spaces.Discrete(len(pairs))
        else:
            raise InputError("no such actions", field="action", value=kind, expected="continuous or discrete")

    def put(self, actions: Any, shares: Floats) -> None:
        """Write the actions of E environments as shares of speed and yaw rate into `shares` (E, 2).

        Raises
        ------
        InputError
            If they are no actions. Whether they are finite is not looked at.
        """
        one: Any = self.space.shape
        try:
            fits = np.shape(actions) == (len(shares), *one)
            if fits:
                shares[:] = actions if self._table is None else self._table[self._chosen(actions)]
        except (ValueError, TypeError):
            fits = False
        if not fits:
            raise _no_action(actions, f"{type(self.space).__name__}, shape {one}, for each of {len(shares)}")

    def commands(self, actions: Any) -> Floats:
        """Return the commands, (K, 2), speed in m/s and yaw rate in rad/s, of K actions.

        Raises
        ------
        InputError
            If they are no actions.
        """
        try:
            count = len(actions)
        except TypeError:
            count = 1
        shares = np.zeros((count, 2))
        self.put(actions, shares)
        if not np.isfinite(shares).all():
            raise _no_action(actions, "finite numbers")
        return np.minimum(np.maximum(shares, -1.0), 1.0) * self.half + self.middle

    def _chosen(self, actions: Any) -> Any:
        chosen = np.asarray(actions)
        if not np.issubdtype(chosen.dtype, np.integer):
            raise _no_action(actions, "an integer each")
        if len(chosen) and not (chosen.min() >= 0 and chosen.max() < len(SPEEDS) * len(TURNS)):
            raise _no_action(actions, f"from 0 to {len(SPEEDS) * len(TURNS) - 1}")
        return chosen


def _no_action(actions: object, expected: str) -> InputError:
    return InputError("not an action", field="action", value=actions, expected=expected)
