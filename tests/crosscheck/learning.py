"""A program, where Stable-Baselines3 is installed: checks the adapter, learns with it, and tells of that in JSON."""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from stable_baselines3 import DQN, PPO
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import VecEnv, VecMonitor, VecNormalize

from dubins_traffic.envs.stable_baselines import vec_env
from dubins_traffic.envs.vector import TrafficVectorEnv

GIVEN: dict[str, Any] = {"action": "discrete", "frame_skip": 6, "autoreset_mode": "SameStep"}
ENVS, STEPS = 8, 700


def checked() -> dict[str, int]:
    """Compare the steps of the adapted environment with those of one that nobody has adapted; return what was met."""
    adapted, plain = (TrafficVectorEnv(ENVS, "junction", **GIVEN) for _ in range(2))
    env = vec_env(adapted)
    assert isinstance(env, VecEnv)
    assert env.seed(5) == [5] * ENVS
    seen, wanted = env.reset(), plain.reset(seed=5)[0]
    dice, met = np.random.default_rng(1), {"checked": 0, "over": 0, "truncated": 0, "outcomes": 0}
    for _ in range(STEPS):
        assert np.array_equal(seen, wanted)
        actions = dice.integers(plain.single_action_space.n, size=ENVS)
        seen, rewards, over, infos = env.step(actions)
        wanted, earned, terminated, truncated, told = plain.step(actions)
        assert np.array_equal(rewards, earned.astype(np.float32))
        assert np.array_equal(over, terminated | truncated)
        assert [info["cost"] for info in infos] == told["cost"].tolist()
        for k in np.flatnonzero(over):
            assert np.array_equal(infos[k]["terminal_observation"], told["final_obs"][k])
            assert infos[k]["TimeLimit.truncated"] == truncated[k]
            met["truncated"] += int(truncated[k])
            met["outcomes"] += repr(infos[k]["outcome"]) == repr(told["final_info"]["outcome"][k])
        assert all("terminal_observation" not in infos[k] for k in np.flatnonzero(~over))
        met["checked"] += ENVS
        met["over"] += int(over.sum())
    env.reset()
    assert np.array_equal(env.reset(), (plain.reset(), plain.reset())[1][0]), "the seed is used once"
    assert env.get_attr("num_envs", [1, 3]) == [ENVS, ENVS]
    assert env.env_method("get_attr", "num_envs", indices=2) == [(ENVS,) * ENVS]
    assert env.env_is_wrapped(VecMonitor, indices=0) == [False]
    env.close()
    return met


def learned() -> dict[str, int]:
    """Let two learners learn for a while, with the wrappers that are usual, and a policy be evaluated and kept."""
    env = VecNormalize(VecMonitor(vec_env(TrafficVectorEnv(ENVS, "junction", **GIVEN))))
    model = PPO("MlpPolicy", env, n_steps=64, batch_size=128, n_epochs=1, seed=3, device="cpu")
    model.learn(8_192)
    returns, lengths = evaluate_policy(model, env, n_eval_episodes=ENVS, return_episode_rewards=True)
    assert len(returns) == len(lengths) == ENVS
    with tempfile.TemporaryDirectory() as folder:
        model.save(Path(folder) / "a.zip")
        again = PPO.load(Path(folder) / "a.zip", env=env, device="cpu")
    shown = env.reset()
    same = [own.predict(shown, deterministic=True)[0] for own in (model, again)]
    assert np.array_equal(*same)
    DQN("MlpPolicy", env, learning_starts=256, seed=3, device="cpu", buffer_size=2_000).learn(1_024)
    return {"learned": model.num_timesteps, "episodes": len(model.ep_info_buffer or ())}


if __name__ == "__main__":
    json.dump(checked() | learned(), sys.stdout)
