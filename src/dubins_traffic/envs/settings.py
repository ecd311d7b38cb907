"""The settings of an environment: configuration, observations, actions, terms of the reward."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from dubins_traffic.cars.dynamics import require_dubins
from dubins_traffic.engine.egos import can_share, undisturbed
from dubins_traffic.envs.actions import ActionMap
from dubins_traffic.envs.episodes import Episodes, Levels
from dubins_traffic.envs.formulas import with_formulas
from dubins_traffic.envs.terms import weights_of
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.observations.flat import SHOWN, Layout
from dubins_traffic.problem.configuration import Configuration, load_config
from dubins_traffic.problem.instance import Instance

OBSERVATIONS: Final = ("flat", "dict", "object")


@dataclass(frozen=True)
class Settings:
    """The checked settings that environments of one kind share.

    Parameters
    ----------
    config : Configuration, path, name or mapping
        What the trials are drawn from.
    observation : str
        ``flat``, ``dict`` (the parts of the flat vector by name) or ``object`` (`cars.state.Observation`).
    action : str
        ``continuous`` or ``discrete``.
    frame_skip : int
        Ticks of a step, for which its command is held.
    reward : mapping, optional
        Weights of terms by name, where they are not those of `envs.terms.WEIGHTS`.
    cars : int
        Other cars that a flat observation shows, at most.
    levels : int, mapping or Levels, optional
        A pool of road networks that are drawn once.
    formulas : mapping, optional
        Formulas (docs/verdicts.md), texts by name, whose states are told in ``info["formulas"]``: what is said of each
        so far, judged after every tick. The trials know nothing of them.

    Raises
    ------
    InputError
        If anything of this is wrong, or the configuration asks for what environments do not have: another simulator,
        formulas, remote cars.
    """

    config: Configuration | str | os.PathLike[str] | Mapping[str, Any]
    observation: str = "flat"
    action: str = "continuous"
    frame_skip: int = 1
    reward: Mapping[str, float] | None = None
    cars: int = SHOWN
    levels: Levels | Mapping[str, Any] | int | None = None
    formulas: Mapping[str, str] | None = None
    episodes: Episodes = field(init=False)
    actions: ActionMap = field(init=False)
    weights: Floats = field(init=False)
    sample: Instance = field(init=False)
    layout: Layout = field(init=False)

    def __post_init__(self) -> None:
        if self.observation not in OBSERVATIONS:
            raise _wrong("observation", self.observation, " or ".join(OBSERVATIONS))
        for name, low in (("frame_skip", 1), ("cars", 0)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < low:
                raise _wrong(name, value, f"an integer >= {low}")
        own = self.config if isinstance(self.config, Configuration) else load_config(self.config)
        episodes = Episodes(own, Levels.of(self.levels))
        (sample,) = episodes.draw([(0, 0, 0)])
        require_dubins(sample.problem.car, "environments move cars together, which is")
        if not can_share(sample):
            expected = "the embedded simulator, no formulas, no remote cars"
            raise InputError(
                "can't be an environment", file=own.file, value=sample.simulator, expected=expected
            )
        if self.formulas:
            with_formulas(sample, self.formulas)
        found = {
            "episodes": episodes,
            "actions": ActionMap(self.action, sample.problem.car.bounds),
            "weights": weights_of(self.reward),
            "sample": sample,
            "layout": Layout.of(sample.problem, self.cars),
        }
        for name, value in found.items():
            object.__setattr__(self, name, value)

    @property
    def disturbed(self) -> bool:
        """Whether observations have noise, or commands are delayed or lost."""
        return not undisturbed(self.sample)


def _wrong(name: str, value: object, expected: str) -> InputError:
    return InputError("can't be an environment", field=name, value=value, expected=expected)
