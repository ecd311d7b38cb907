"""What the adapter for Stable-Baselines3 refuses; tests/crosscheck/learners.py learns with it."""

from __future__ import annotations

import sys

import pytest

from dubins_traffic.envs.stable_baselines import vec_env
from dubins_traffic.envs.vector import TrafficVectorEnv
from dubins_traffic.errors import DubinsTrafficError, InputError


@pytest.mark.parametrize("mode", ["NextStep", "Disabled"])
def test_episodes_must_begin_when_it_thinks_that_they_do(mode: str) -> None:
    env = TrafficVectorEnv(2, "junction", autoreset_mode=mode)
    with pytest.raises(InputError, match=f"autoreset_mode: .*: got '{mode}'; expected SameStep"):
        vec_env(env)


def test_without_the_library_it_says_what_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "stable_baselines3", None)
    env = TrafficVectorEnv(2, "junction", autoreset_mode="SameStep")
    with pytest.raises(DubinsTrafficError, match="needs Stable-Baselines3, which can't be imported"):
        vec_env(env)
