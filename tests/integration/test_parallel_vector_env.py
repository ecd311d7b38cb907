"""Many environments in which several cars learn: the same episodes as in the environment for PettingZoo, at once."""

from __future__ import annotations

import pickle
from time import process_time
from typing import Any

import numpy as np
import pytest
from benchmarks.batch import configuration

from dubins_traffic.cars.state import EGO
from dubins_traffic.envs.crew import OF_A_CAR, agent_name
from dubins_traffic.envs.parallel import parallel_env
from dubins_traffic.envs.parallel_vector import TrafficParallelVectorEnv
from dubins_traffic.envs.shielded import Shielded
from dubins_traffic.envs.vector import TrafficVectorEnv
from dubins_traffic.errors import DubinsTrafficError, InputError
from dubins_traffic.kernels.arrays import Floats
from tests.integration.test_parallel_env import config


def actions(env: TrafficParallelVectorEnv, steps: int) -> Floats:
    """Return actions of all steps, of environment i the same whatever the number of environments, rather forward."""
    shape = steps, len(env.agents), 2
    each = [np.random.default_rng(i).uniform(-1.0, 1.0, shape) + np.array([0.5, 0.0]) for i in range(env.num_envs)]
    return np.clip(np.stack(each, axis=1), -1.0, 1.0)


@pytest.mark.parametrize(
    "more",
    [
        {},
        {"roles": "peers", "excuses": "window", "frame_skip": 4},
        {"ego": "rules", "learned": ["a1"], "frame_skip": 3},
        {"ego": "lanes", "shielded": ["car_1", "car_2", "car_3"]},
        {"shielded": ["ego_0", "car_2"], "excuses": False},
    ],
)
@pytest.mark.path
def test_each_environment_has_the_episodes_of_the_environment_for_pettingzoo(more: dict[str, Any]) -> None:
    """Bit for bit, for two episodes, with what its infos say; environments do not know how many there are."""
    given = {key: value for key, value in more.items() if key != "shielded"}
    shields: Any = dict.fromkeys(more.get("shielded", []), "law")
    many = TrafficParallelVectorEnv(3, config(seconds=3.0), shields=shields, **given)
    few = TrafficParallelVectorEnv(1, config(seconds=3.0), shields=shields, **given)
    one: Any = parallel_env(config(seconds=3.0), **given)
    one = Shielded(one, more["shielded"], overtakes="law") if shields else one
    asked = actions(many, 200)
    seen, _ = one.reset(seed=7)
    found, info = many.reset(seed=7)
    few.reset(seed=7)
    assert info["trial"][0] == one.unwrapped.trial
    assert np.array_equal(found[0], np.array(list(seen.values())))
    assert np.array_equal(many.state()[0], one.unwrapped.state())
    ends = 0
    for step in asked:
        seen, rewards, terminated, truncated, infos = one.step(dict(zip(one.agents, step[0], strict=True)))
        found, got, ended, cut, info = many.step(step)
        alone = few.step(step[:1])
        assert np.array_equal(found[:1], alone[0])
        assert np.array_equal(got[:1], alone[1])
        assert got[0].tolist() == list(rewards.values())
        assert info["cost"][0].tolist() == [own["cost"] for own in infos.values()]
        told = next(own["broke_first"] for own in infos.values())
        assert told == (None if info["broke_first"][0] < 0 else agent_name(info["broke_first"][0]))
        for k, own in enumerate(infos.values()):
            assert {name: info["costs"][name][0, k] for name in own["costs"]} == own["costs"]
            paid = {name: info["reward_terms"][name][0, k] for name in own["reward_terms"]}
            assert paid == own["reward_terms"]
            assert "interventions" not in own or own["interventions"] == info["interventions"][0, k]
        over = not one.agents
        assert (bool(ended[0]), bool(cut[0])) == (any(terminated.values()), any(truncated.values()))
        assert over == (0 in info.get("ended", ()))
        if over:
            ends += 1
            assert np.array_equal(info["final_obs"][0], np.array(list(seen.values())))
            assert info["final_state"].shape == (len(info["ended"]), many.state_size)
            assert info["outcome"][0].ending.ticks == len(one.unwrapped.commands)
            seen, _ = one.reset()
            if ends == 2:
                break
        assert np.array_equal(found[0], np.array(list(seen.values())))
    assert ends == 2


def test_the_state_says_where_all_cars_are() -> None:
    env = TrafficParallelVectorEnv(2, config(), learned=["a0"], ego="rules")
    _, info = env.reset(seed=1)
    state = env.state().reshape(2, 4, OF_A_CAR)
    assert (np.abs(state[..., :2]) <= 1.0).all()
    for own, trial in zip(state, info["trial"], strict=True):
        assert np.allclose(own[:, 2:4], [(start.c, start.s) for start in trial.starts], atol=1e-6)
        apart = np.subtract(own[1, :2], own[EGO, :2])
        true = np.array([trial.starts[1].x - trial.starts[0].x, trial.starts[1].y - trial.starts[0].y])
        assert apart[0] * true[1] - apart[1] * true[0] == pytest.approx(0.0, abs=1e-5)
        assert apart @ true > 0.0


def test_a_copy_goes_on_as_its_environment_does() -> None:
    env = TrafficParallelVectorEnv(2, config(seconds=2.0), frame_skip=5)
    env.reset(seed=3)
    asked = actions(env, 20)
    for step in asked[:6]:
        env.step(step)
    copy = pickle.loads(pickle.dumps(env))
    for step in asked[6:]:
        both = env.step(step), copy.step(step)
        assert np.array_equal(both[0][0], both[1][0])
        assert np.array_equal(both[0][1], both[1][1])


def test_what_makes_no_sense_is_named() -> None:
    with pytest.raises(InputError, match="num_envs: can't be a vector environment"):
        TrafficParallelVectorEnv(0, config())
    with pytest.raises(InputError, match="shields: no such agent: got 'car_9'"):
        TrafficParallelVectorEnv(1, config(), shields={"car_9": "sure"})
    with pytest.raises(InputError, match="overtakes: not a way to overtake"):
        TrafficParallelVectorEnv(1, config(), shields={"car_1": "often"})
    env = TrafficParallelVectorEnv(2, config())
    with pytest.raises(DubinsTrafficError, match="have to be reset"):
        env.step(np.zeros((2, 4, 2)))
    env.reset(seed=1)
    with pytest.raises(InputError, match=r"action: not actions.*4 cars of 2 environments"):
        env.step(np.zeros((2, 3, 2)))
    with pytest.raises(InputError, match="action: not an action"):
        env.step(np.full((2, 4, 2), np.nan))
    with pytest.raises(InputError, match="action: not an action"):
        env.step(np.zeros((2, 4, 3)))


def test_eight_learners_are_stepped_at_the_rate_of_one() -> None:
    """At least 0.4 of the steps of environments of one learner, each learner's step counted; twice when measured."""
    envs, steps = 32, 150
    own = configuration(7, 20)
    rates: list[float] = []
    for env, shape in (
        (TrafficVectorEnv(envs, own), (envs, 2)),
        (TrafficParallelVectorEnv(envs, own), (envs, 8, 2)),
    ):
        env.reset(seed=1)
        step = np.random.default_rng(1).uniform(0.0, 1.0, shape)
        for _ in range(20):
            env.step(step)
        began = process_time()
        for _ in range(steps):
            env.step(step)
        rates.append(np.prod(shape[:-1]) * steps / (process_time() - began))
    assert rates[1] >= 0.4 * rates[0]
