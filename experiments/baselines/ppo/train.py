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
from pathlib import Path
from typing import Any

import numpy as np
import torch
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper

from dubins_traffic.envs.episodes import Levels
from dubins_traffic.envs.parallel_vector import TrafficParallelVectorEnv
from dubins_traffic.envs.stable_baselines import vec_env
from dubins_traffic.envs.vector import TrafficVectorEnv
from dubins_traffic.learning.policy import CHOICES, Policy

CONFIG, CARS, SKIP, ENVS, LEVELS = "junction", 3, 6, 64, 200
"""What is learned, other cars that are shown, ticks of an action, environments at once, road networks to learn on."""
STEPS, GAMMA, HIDDEN = 6_000_000, 0.995, [128, 64]
BUDGET, RATE = 1.0, 0.05
"""Breaches that an episode may cost, and how fast the multiplier follows."""


class Charged(VecEnvWrapper):
    """Takes a multiple of the cost from the reward, and notes what each episode has cost."""

    def __init__(self, venv: VecEnv) -> None:
        super().__init__(venv)
        self.multiplier = 0.0
        self.costs: list[float] = []
        self._spent = np.zeros(venv.num_envs)

    def reset(self) -> Any:
        """Begin the next episodes."""
        return self.venv.reset()

    def step_wait(self) -> Any:
        """Take the step."""
        observations, rewards, over, infos = self.venv.step_wait()
        cost = np.array([info["cost"] for info in infos])
        self._spent += cost
        self.costs += self._spent[over].tolist()
        self._spent[over] = 0.0
        charged = (rewards - self.multiplier * cost) / (1.0 + self.multiplier)
        return observations, charged.astype(np.float32), over, infos


class Shielded:
    """The environments of an ego under the shield, whose interface is that of a vector environment of one learner."""

    def __init__(self, env: TrafficParallelVectorEnv) -> None:
        self._env, self.num_envs, self.settings = env, env.num_envs, env.settings
        self.autoreset_mode, self.render_mode = AutoresetMode.SAME_STEP, None
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
        told: dict[str, Any] = {"cost": info["cost"][:, 0], "final_obs": dict[int, Any](), "final_info": {}}
        if "ended" in info:
            last = info["final_obs"][:, 0, : self._size]
            told["final_obs"] = dict(zip(info["ended"].tolist(), last, strict=True))
        return seen[:, 0, : self._size], rewards[:, 0], terminated, truncated, told

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Return an attribute for each environment; all have the same."""
        return (getattr(self, name),) * self.num_envs

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
        own = TrafficParallelVectorEnv(ENVS, CONFIG, learned=[], shields={"ego_0": "sure"}, excuses=False, **given)
        return Shielded(own)
    return TrafficVectorEnv(ENVS, CONFIG, autoreset_mode="SameStep", **given)


def train(seed: int, steps: int, *, lagrangian: bool, shielded: bool) -> Policy:
    """Return a policy that has learned."""
    torch.set_num_threads(1)
    env = environments(shielded=shielded)
    model = PPO(
        "MlpPolicy", Charged(vec_env(env)), n_steps=128, batch_size=2048, n_epochs=5, gamma=GAMMA, gae_lambda=0.95,
        ent_coef=0.01, learning_rate=3e-4, seed=seed, device="cpu",
        policy_kwargs={"net_arch": HIDDEN, "activation_fn": torch.nn.Tanh},
    )  # fmt: skip
    model.learn(steps, callback=Follows(lagrangian=lagrangian))
    parts = [*model.policy.mlp_extractor.policy_net, model.policy.action_net]
    layers = [part for part in parts if isinstance(part, torch.nn.Linear)]
    kept = tuple(
        (own.weight.detach().numpy().astype(np.float64), own.bias.detach().numpy().astype(np.float64)) for own in layers
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
