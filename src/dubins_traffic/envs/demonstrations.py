"""Datasets for offline learning, in Minari's format: what a driver saw, did and was paid in episodes."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from importlib import import_module
from typing import Any, Final

import gymnasium
import numpy as np

from dubins_traffic.controllers.registry import load
from dubins_traffic.envs.settings import ActionMap
from dubins_traffic.envs.single import TrafficEnv
from dubins_traffic.errors import InputError, needs
from dubins_traffic.problem.configuration import Configuration, load_config

NAME: Final = "dubins_traffic.envs:dubins_traffic/Traffic-v0"
"""The environment of a dataset; its arguments are among what Minari keeps of it."""


def write_minari(
    dataset: str, config: Configuration | str | Mapping[str, Any], controller: str, *, episodes: int,
    seed: int = 0, frame_skip: int = 1, reward: Mapping[str, float] | str | None = None, **given: Any,
) -> Any:  # fmt: skip
    """Drive episodes by a controller, and keep them as a dataset of Minari; return it.

    The flat observation is kept, and as actions those that the environment was given, so that they give the same
    episodes again. ``infos["cost"]`` has the costs.

    Parameters
    ----------
    dataset : str
        Its name for Minari, such as ``dubins-traffic/junction/rules-v0``; it stands where Minari keeps datasets.
    config
        What the trials are drawn from.
    controller : str
        Who drives, by its name; asked once a step.
    episodes : int
        The first episodes of environment 0 under `seed`.
    frame_skip, reward
        As in `envs.settings.Settings`, like what is further `given`.

    Raises
    ------
    MissingExtraError
        Without the extra `minari`.
    InputError
        If Minari has a dataset of that name, or refuses the name; if the controller gives up; and as `TrafficEnv`.
    """
    with needs("writing datasets", "minari"):
        minari, collector = import_module("minari"), import_module("minari.data_collector")
    whole = config if isinstance(config, Configuration) else load_config(config)
    more: dict[str, Any] = {
        "config": whole.to_document(),
        "frame_skip": frame_skip,
        "reward": reward,
        **given,
    }
    shown = gymnasium.make(NAME, disable_env_checker=True, **more)
    env = TrafficEnv(observation="object", **more)
    which = [{"seed": seed, "options": {"episode": number}} for number in range(episodes)]
    buffers = [
        collector.EpisodeBuffer(id=number, **who, **_driven(env, controller, who)) for number, who in enumerate(which)
    ]
    with warnings.catch_warnings():
        # It warns of authors and links, which whoever publishes a dataset adds.
        warnings.simplefilter("ignore", UserWarning)
        try:
            return minari.create_dataset_from_buffers(
                dataset, buffer=buffers, env=shown, algorithm_name=controller, data_format="arrow",
                description=f"{episodes} episodes from seed {seed}, driven by {controller}",
            )  # fmt: skip
        except ValueError as error:
            raise InputError(f"no dataset ({error})", field="dataset", value=dataset) from None


def _driven(env: TrafficEnv, controller: str, which: Mapping[str, Any]) -> dict[str, Any]:
    """Drive the episode that `which` (arguments of a reset) names, and return it in Minari's words."""
    seen, info = env.reset(**which)
    driver = load(controller)
    driver.start(info["trial"].problem)
    kept = _Kept(env)
    while not kept.over:
        command = driver.act(seen)
        if command is None:
            expected = "a command in every step"
            raise InputError("gives up", file=controller, value=dict(which), expected=expected)
        seen = kept.step(_shares(env.settings.actions, command))
    return kept.columns()


def _shares(actions: ActionMap, command: tuple[float, float]) -> Any:
    """Return the action that stands for a command, m/s and rad/s, (2,) float32; bounds hold as for any action."""
    return np.clip((np.array(command) - actions.middle) / actions.half, -1.0, 1.0).astype(np.float32)


class _Kept:
    """Steps an environment that has been reset, and keeps its episode."""

    def __init__(self, env: TrafficEnv) -> None:
        self._env = env
        self.over = False
        self._seen, self._costs = [self._flat()], [0.0]
        self._actions: list[Any] = []
        self._rewards: list[float] = []
        self._ends: list[tuple[bool, bool]] = []

    def step(self, action: Any) -> Any:
        """Take a step; return what the controller sees next."""
        seen, reward, terminated, truncated, info = self._env.step(action)
        self._seen.append(self._flat())
        self._actions.append(action)
        self._rewards.append(reward)
        self._ends.append((terminated, truncated))
        self._costs.append(info["cost"])
        self.over = terminated or truncated
        return seen

    def columns(self) -> dict[str, Any]:
        """Return the episode in Minari's words."""
        terminations, truncations = zip(*self._ends, strict=True)
        return {
            "observations": self._seen, "actions": self._actions, "rewards": self._rewards,
            "terminations": list(terminations), "truncations": list(truncations), "infos": {"cost": self._costs},
        }  # fmt: skip

    def _flat(self) -> Any:
        return self._env.fleet.board.arrays["flat"][0].copy()
