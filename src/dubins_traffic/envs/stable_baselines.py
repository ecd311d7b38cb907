"""The adapter for Stable-Baselines3: a vector environment as its `VecEnv`.

Stable-Baselines3 is no dependency, of no extra either, since it brings gigabytes; it is imported when it is asked for.

Source: A. Raffin, A. Hill, A. Gleave, A. Kanervisto, M. Ernestus, N. Dormann, *Stable-Baselines3: reliable
reinforcement learning implementations*, 2021.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium.vector import AutoresetMode

from dubins_traffic.errors import DubinsTrafficError, InputError

if TYPE_CHECKING:
    from dubins_traffic.envs.vector import TrafficVectorEnv


def vec_env(env: TrafficVectorEnv) -> Any:
    """Return a vector environment as a `stable_baselines3.common.vec_env.VecEnv`, for its learners and wrappers.

    The infos of each environment hold its `cost` in the step; those of one whose episode is over also
    ``terminal_observation``, ``TimeLimit.truncated`` and the `outcome`, if the episode has one.

    Parameters
    ----------
    env : TrafficVectorEnv
        Begins an episode in the step in which the last one ends (``autoreset_mode="SameStep"``).

    Raises
    ------
    InputError
        If it begins them at another time.
    DubinsTrafficError
        If Stable-Baselines3 is not installed.
    """
    if env.autoreset_mode is not AutoresetMode.SAME_STEP:
        raise InputError(
            "begins episodes when Stable-Baselines3 does not", field="autoreset_mode",
            value=env.autoreset_mode.value, expected=AutoresetMode.SAME_STEP.value,
        )  # fmt: skip
    try:
        base = import_module("stable_baselines3.common.vec_env").VecEnv
    except ImportError as error:
        raise DubinsTrafficError(f"needs Stable-Baselines3, which can't be imported: {error}") from error
    return type("StableBaselinesEnv", (_Adapter, base), {})(env)


class _Adapter:
    """What a `VecEnv` is asked for, answered by a vector environment."""

    def __init__(self, env: TrafficVectorEnv) -> None:
        self.env: Any = env
        self._next_seed: int | None = None
        spaces = self.env.single_observation_space, self.env.single_action_space
        super().__init__(env.num_envs, *spaces)  # pyright: ignore[reportCallIssue]  # that of `VecEnv`

    def reset(self) -> Any:
        """Begin the first episodes of the seed that has been given, or the next ones."""
        observations, _ = self.env.reset(seed=self._next_seed)
        self._next_seed = None
        return observations

    def step_async(self, actions: Any) -> None:
        """Keep the actions of the step."""
        self._actions = actions

    def step_wait(self) -> tuple[Any, Any, Any, list[dict[str, Any]]]:
        """Take the step; return observations, rewards, who is over, and infos."""
        observations, rewards, terminated, truncated, told = self.env.step(self._actions)
        over = terminated | truncated
        infos: list[dict[str, Any]] = [{"cost": cost} for cost in told["cost"].tolist()]
        for env in np.flatnonzero(over).tolist():
            infos[env] |= {
                "terminal_observation": told["final_obs"][env],
                "TimeLimit.truncated": bool(truncated[env]),
            }
            outcomes = told["final_info"].get("outcome")
            if outcomes is not None and outcomes[env] is not None:
                infos[env]["outcome"] = outcomes[env]
        return observations, rewards.astype(np.float32), over, infos

    def close(self) -> None:
        """Close the environments."""
        self.env.close()

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Let the next `reset` begin with the first episodes of a seed."""
        self._next_seed = seed
        return [seed] * self.env.num_envs

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute of some environments."""
        return self._some(self.env.get_attr(attr_name), indices)

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:  # noqa: ARG002  # refused
        """Refuse to set an attribute: the environments are one object.

        Raises
        ------
        DubinsTrafficError
            Always.
        """
        raise DubinsTrafficError(f"{attr_name}: the environments share it: set it on the vector environment")

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Return what a method gives for some environments."""
        return self._some(self.env.call(method_name, *args, **kwargs), indices)

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:  # noqa: ARG002  # none is
        """Tell that no environment has a wrapper of its own."""
        return self._some([False] * self.env.num_envs, indices)

    def _some(self, values: Sequence[Any], indices: Any) -> list[Any]:
        """Return the values of the environments of some numbers, of one, or of all (None)."""
        numbers = range(len(values)) if indices is None else np.atleast_1d(indices).tolist()
        return [values[number] for number in numbers]
