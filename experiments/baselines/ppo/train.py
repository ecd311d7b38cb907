"""Train policies by PPO, with Stable-Baselines3, or by PPO with a Lagrange multiplier on breaches.

    python -m experiments.baselines.ppo.train SEED [--lagrangian] [--shielded] [--steps N] [--save FILE]

With `--shielded` the ego learns under the shield, which replaces what would break a rule.

Schulman, Wolski, Dhariwal, Radford, Klimov, Proximal policy optimization algorithms, arXiv:1707.06347, eq. 7.
Ray, Achiam, Amodei, Benchmarking safe exploration in deep reinforcement learning, 2019, section 4 (the multiplier: it
grows while an episode costs more than its budget, and what is maximized is the return less the multiplier times the
cost, divided by one and the multiplier).
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from gymnasium.spaces import Box
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv

from dubins_traffic.envs.episodes import Levels
from dubins_traffic.envs.parallel_vector import TrafficParallelVectorEnv
from dubins_traffic.envs.vector import TrafficVectorEnv
from dubins_traffic.learning.actions import CHOICES
from dubins_traffic.learning.policy import Policy

CONFIG, CARS, SKIP, ENVS, LEVELS = "junction", 3, 6, 64, 200
"""What is learned, other cars that are shown, ticks of an action, environments at once, road networks to learn on."""
STEPS, GAMMA, HIDDEN = 6_000_000, 0.995, [128, 64]
BUDGET, RATE = 1.0, 0.05
"""Breaches that an episode may cost, and how fast the multiplier follows."""


class Vectorized(VecEnv):
    """A vector environment with the interface of Stable-Baselines3; it may charge costs with a multiplier."""

    def __init__(self, env: TrafficVectorEnv | Shielded) -> None:
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)
        self.env, self.multiplier = env, 0.0
        self.costs: list[float] = []
        self._spent = np.zeros(env.num_envs)
        self._seed: int | None = None

    def reset(self) -> Any:
        """Begin the first episodes of the seed, or the next ones."""
        observations, _ = self.env.reset(seed=self._seed)
        self._seed = None
        return observations

    def step_async(self, actions: Any) -> None:
        """Note what is to be done."""
        self._actions = actions

    def step_wait(self) -> Any:
        """Do it."""
        observations, rewards, terminated, truncated, info = self.env.step(self._actions)
        over = terminated | truncated
        self._spent += info["cost"]
        rewards = (rewards - self.multiplier * info["cost"]) / (1.0 + self.multiplier)
        infos: list[dict[str, Any]] = [{} for _ in over]
        for env in np.flatnonzero(over):
            infos[env] = {
                "terminal_observation": info["final_obs"][env], "TimeLimit.truncated": bool(truncated[env]),
            }  # fmt: skip
            self.costs.append(float(self._spent[env]))
            self._spent[env] = 0.0
        return observations, rewards.astype(np.float32), over, infos

    def close(self) -> None:
        """Close the environments."""
        self.env.close()

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Begin with the episodes of a seed at the next reset."""
        self._seed = seed
        return [seed] * self.num_envs

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute for each environment; all have the same."""
        return [getattr(self.env, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:  # noqa: ARG002  # all are one
        """Set an attribute of all environments."""
        setattr(self.env, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Refuse: all environments are one object."""
        raise NotImplementedError(method_name)

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:  # noqa: ARG002  # none is
        """Tell that no environment has a wrapper."""
        return [False] * self.num_envs


class Shielded:
    """The environments of an ego under the shield, whose interface is that of a vector environment of one learner."""

    def __init__(self, env: TrafficParallelVectorEnv) -> None:
        self._env, self.num_envs, self.settings = env, env.num_envs, env.settings
        self._size = env.settings.layout.size
        self.single_observation_space = Box(-1.0, 1.0, (self._size,), np.float32)
        self.single_action_space = env.single_action_space

    def reset(self, seed: int | None = None) -> Any:
        """Begin the first episodes of a seed, or the next ones."""
        seen, info = self._env.reset(seed=seed)
        return seen[:, 0, : self._size], info

    def step(self, actions: Any) -> Any:
        """Hold the actions of the egos."""
        seen, rewards, terminated, truncated, info = self._env.step(np.asarray(actions)[:, None])
        told: dict[str, Any] = {"cost": info["cost"][:, 0], "final_obs": dict[int, Any]()}
        if "ended" in info:
            last = info["final_obs"][:, 0, : self._size]
            told["final_obs"] = dict(zip(info["ended"].tolist(), last, strict=True))
        return seen[:, 0, : self._size], rewards[:, 0], terminated, truncated, told

    def close(self) -> None:
        """Do nothing: there is nothing to close."""


class Follows(BaseCallback):
    """Lets the multiplier follow what episodes cost, and prints how training goes."""

    def __init__(self, *, lagrangian: bool) -> None:
        super().__init__()
        self._lagrangian = lagrangian

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        env: Any = self.training_env
        if env.costs:
            cost = float(np.mean(env.costs))
            env.costs.clear()
            if self._lagrangian:
                env.multiplier = max(0.0, env.multiplier + RATE * (cost - BUDGET))
            print(
                f"{self.num_timesteps:>9,} steps: {cost:.2f} breaches an episode, multiplier {env.multiplier:.2f}",
                flush=True,
            )


def environments(*, shielded: bool) -> TrafficVectorEnv | Shielded:
    """Return the environments to learn in."""
    given: dict[str, Any] = {"action": "discrete", "frame_skip": SKIP, "cars": CARS, "levels": Levels(LEVELS)}
    if shielded:
        own = TrafficParallelVectorEnv(
            ENVS, CONFIG, learned=[], shields={"ego_0": "sure"}, excuses=False, **given
        )
        return Shielded(own)
    return TrafficVectorEnv(ENVS, CONFIG, autoreset_mode="SameStep", **given)


def train(seed: int, steps: int, *, lagrangian: bool, shielded: bool) -> Policy:
    """Return a policy that has learned."""
    torch.set_num_threads(1)
    env = environments(shielded=shielded)
    model = PPO(
        "MlpPolicy", Vectorized(env), n_steps=128, batch_size=2048, n_epochs=5, gamma=GAMMA, gae_lambda=0.95,
        ent_coef=0.01, learning_rate=3e-4, seed=seed, device="cpu",
        policy_kwargs={"net_arch": HIDDEN, "activation_fn": torch.nn.Tanh},
    )  # fmt: skip
    model.learn(steps, callback=Follows(lagrangian=lagrangian))
    parts = [*model.policy.mlp_extractor.policy_net, model.policy.action_net]
    layers = [part for part in parts if isinstance(part, torch.nn.Linear)]
    kept = tuple(
        (own.weight.detach().numpy().astype(np.float64), own.bias.detach().numpy().astype(np.float64))
        for own in layers
    )
    return Policy(tuple(env.settings.layout.names), CARS, SKIP, kept, CHOICES)


def main() -> None:
    """Train as asked, and write the policy."""
    parser = argparse.ArgumentParser(prog="experiments.baselines.ppo.train")
    parser.add_argument("seed", type=int)
    parser.add_argument("--lagrangian", action="store_true")
    parser.add_argument("--shielded", action="store_true")
    parser.add_argument("--steps", type=int, default=STEPS)
    parser.add_argument("--save", type=Path)
    asked = parser.parse_args()
    kind = "lagrangian" if asked.lagrangian else "shielded" if asked.shielded else "ppo"
    policy = train(asked.seed, asked.steps, lagrangian=asked.lagrangian, shielded=asked.shielded)
    policy.save(asked.save or Path(__file__).parent / f"{kind}-{asked.seed}.npz", overwrite=True)


if __name__ == "__main__":
    main()
