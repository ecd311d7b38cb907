"""The settings of an environment: configuration, observations, actions and their commands, terms of the reward."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from gymnasium import spaces

from dubins_traffic.cars.dynamics import require_dubins
from dubins_traffic.engine.egos import can_share, undisturbed
from dubins_traffic.envs.episodes import Episodes, Levels
from dubins_traffic.envs.terms import weights_of
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.learning.flat import SHOWN, Layout
from dubins_traffic.learning.policy import CHOICES
from dubins_traffic.problem.configuration import Configuration, load_config
from dubins_traffic.problem.instance import Instance
from dubins_traffic.verification.worlds import with_formulas

if TYPE_CHECKING:
    from dubins_traffic.cars.body import Bounds


class ActionMap:
    """The table of the commands that actions stand for.

    Parameters
    ----------
    kind : str
        ``continuous``: two numbers from -1 to 1, speed and yaw rate, scaled to the car's bounds. ``discrete``: one of
        `learning.policy.CHOICES`.

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
            self._table = CHOICES
            self.space = spaces.Discrete(len(CHOICES))
        else:
            raise InputError("no such actions", field="action", value=kind, expected="continuous or discrete")

    def put(self, actions: Any, shares: Floats) -> None:
        """Write the actions of E environments as shares of speed and yaw rate into `shares` (E, 2)."""
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
        """Return the commands, (K, 2), speed in m/s and yaw rate in rad/s, of K actions."""
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
        if len(chosen) and not (chosen.min() >= 0 and chosen.max() < len(CHOICES)):
            raise _no_action(actions, f"from 0 to {len(CHOICES) - 1}")
        return chosen


def _no_action(actions: object, expected: str) -> InputError:
    return InputError("not an action", field="action", value=actions, expected=expected)


OBSERVATIONS: Final = ("flat", "dict", "object")


@dataclass(frozen=True)
class Settings:
    """The checked settings that environments of one kind share."""

    config: Configuration | str | os.PathLike[str] | Mapping[str, Any]
    """What the trials are drawn from."""
    observation: str = "flat"
    """``flat``, ``dict`` (the parts of the flat vector by name) or ``object`` (`cars.state.Observation`)."""
    action: str = "continuous"
    """``continuous`` or ``discrete``."""
    frame_skip: int = 1
    """Ticks of a step, for which its command is held."""
    reward: Mapping[str, float] | str | None = None
    """Weights of terms by name, where they are not those of `envs.terms.WEIGHTS`; or `envs.terms.SCORE`."""
    cars: int = SHOWN
    """Other cars that a flat observation shows, at most."""
    levels: Levels | Mapping[str, Any] | int | None = None
    """A pool of road networks that are drawn once."""
    formulas: Mapping[str, str] | None = None
    """Formulas (docs/verdicts.md), texts by name, whose states are told in ``info["formulas"]``: what is said of
    each so far, judged after every tick. The trials know nothing of them.
    """
    episodes: Episodes = field(init=False)
    actions: ActionMap = field(init=False)
    weights: Floats = field(init=False)
    debts: Floats = field(init=False)
    sample: Instance = field(init=False)
    layout: Layout = field(init=False)

    def __post_init__(self) -> None:
        if self.observation not in OBSERVATIONS:
            raise _wrong("observation", self.observation, " or ".join(OBSERVATIONS))
        for name, low in (("frame_skip", 1), ("cars", 0)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < low:
                raise _wrong(name, value, f"an integer >= {low}")
        configuration = self.config if isinstance(self.config, Configuration) else load_config(self.config)
        episodes = Episodes(configuration, Levels.of(self.levels))
        (sample,) = episodes.draw([(0, 0, 0)])
        require_dubins(sample.problem.car, "environments move cars together, which is")
        if not can_share(sample):
            expected = "the embedded simulator, no formulas, no remote cars, disturbances of the ego alone"
            raise InputError(
                "can't be an environment", file=configuration.file, value=sample.simulator, expected=expected
            )
        if self.formulas:
            with_formulas(sample, self.formulas)
        weights, debts = weights_of(self.reward)
        parts = {
            "episodes": episodes,
            "actions": ActionMap(self.action, sample.problem.car.bounds),
            "weights": weights,
            "debts": debts,
            "sample": sample,
            "layout": Layout.of(sample.problem, self.cars),
        }
        for name, value in parts.items():
            object.__setattr__(self, name, value)

    @property
    def disturbed(self) -> bool:
        """Whether observations have noise, or commands are delayed or lost."""
        return not undisturbed(self.sample)


def _wrong(name: str, value: object, expected: str) -> InputError:
    return InputError("can't be an environment", field=name, value=value, expected=expected)
