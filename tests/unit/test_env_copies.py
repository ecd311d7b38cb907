"""Copies of environments, made in the middle of an episode, go on as the original; many, and what each is asked."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from typing import Any

import cloudpickle
import gymnasium
import numpy as np
import pytest

from dubins_traffic.envs.episodes import MOST_ENVS, seeds_of
from dubins_traffic.envs.parallel import TrafficParallelEnv
from dubins_traffic.envs.shielded_ego import ShieldedEgo
from dubins_traffic.errors import DubinsTrafficError
from tests.environments import SHORT, single, vector, weaving

NOISY: dict[str, Any] = {**SHORT, "disturbances": {"command_delay": 2, "position_noise": 0.01}}
FORMULAS = {"on the road": "[] on_road_ego"}
COPIES: dict[str, Callable[[Any], Any]] = {
    "copy": copy.deepcopy,
    "pickle": lambda env: pickle.loads(pickle.dumps(env)),
    "cloudpickle": lambda env: cloudpickle.loads(cloudpickle.dumps(env)),
}
MADE: dict[str, Callable[[], Any]] = {
    "flat": single,
    "dict": lambda: single(observation="dict"),
    "object": lambda: single(observation="object"),
    "noisy": lambda: single(NOISY),
    "formulas": lambda: single(formulas=FORMULAS),
    "shielded": lambda: ShieldedEgo(single()),
    "levels": lambda: vector(3, levels=2),
    "vector": lambda: vector(5, frame_skip=2),
}


def plain(value: Any) -> Any:
    """Return what can be compared: arrays as lists, all else by what is written of it."""
    if isinstance(value, np.ndarray) and value.dtype != object:
        return value.tolist()
    if isinstance(value, dict):
        return {name: plain(own) for name, own in value.items()}
    if isinstance(value, tuple | list | np.ndarray):
        return [plain(own) for own in value]
    return repr(value)


def stepped(env: Any, begin: int, steps: int) -> list[Any]:
    """Return what steps give, from the number of the first; an episode that is over begins anew where none does."""
    found: list[Any] = []
    for step in range(begin, begin + steps):
        several = getattr(env, "num_envs", None)
        action = weaving(step) if several is None else np.stack([weaving(step, k) for k in range(several)])
        given = env.step(action)
        found.append(plain(given))
        if several is None and (given[2] or given[3]):
            found.append(plain(env.reset()))
    return found


@pytest.mark.parametrize("way", COPIES)
@pytest.mark.parametrize("kind", MADE)
def test_a_copy_goes_on_as_the_original_does(kind: str, way: str) -> None:
    env = MADE[kind]()
    env.reset(seed=4)
    stepped(env, 0, 40)
    other = COPIES[way](env)
    first, second = stepped(env, 40, 120), stepped(other, 40, 120)
    assert first == second
    assert stepped(env, 160, 5) != first[:5]
    env.close()
    other.close()


@pytest.mark.parametrize("way", COPIES)
def test_a_copy_of_several_learners_goes_on_as_well(way: str) -> None:
    env = TrafficParallelEnv({**SHORT, "e-agents": []})
    env.reset(seed=4)

    def drive(own: Any, begin: int) -> list[Any]:
        return [
            plain(own.step({agent: weaving(step, k) for k, agent in enumerate(own.agents)}))
            for step in range(begin, begin + 20)
        ]

    drive(env, 0)
    other = COPIES[way](env)
    assert drive(env, 20) == drive(other, 20)


def test_of_each_environment_an_attribute_can_be_had_and_a_method_called() -> None:
    env = vector(3, render_mode="rgb_array")
    _, info = env.reset(seed=2)
    assert env.get_attr("trial") == tuple(info["trial"])
    assert env.get_attr("render_mode") == ("rgb_array",) * 3
    pictures = env.call("render")
    assert len(pictures) == 3
    assert all(picture.shape[2] == 3 for picture in pictures)
    for name in ("step", "reset", "close"):
        with pytest.raises(DubinsTrafficError, match="all environments at once"):
            env.call(name)
    with pytest.raises(AttributeError):
        env.get_attr("nothing")


def test_more_environments_than_one_seed_has_trials_for_are_those_of_further_seeds() -> None:
    seeds = seeds_of(7, 2 * MOST_ENVS + 1)
    assert seeds[:2] == [(7, 0), (7, 1)]
    assert len(set(seeds)) == len(seeds)
    assert {number for _, number in seeds[MOST_ENVS:]} == set(range(MOST_ENVS))
    assert all(0 <= seed < 2**64 for seed, _ in seeds_of(2**64 - 1, 2 * MOST_ENVS))
    env = vector(MOST_ENVS + 2)
    _, info = env.reset(seed=7)
    few = vector(2)
    assert few.reset(seed=7)[1]["trial"].tolist() == info["trial"][:2].tolist()
    alone = gymnasium.make("dubins_traffic/Traffic-v0", config=SHORT)
    assert alone.reset(seed=seeds[MOST_ENVS][0])[1]["trial"] == info["trial"][MOST_ENVS]
