"""A single environment under the shield breaks nothing, tells when that steps in, and is the trial that it cites."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from dubins_traffic import Shield
from dubins_traffic.controllers.scripted import Scripted
from dubins_traffic.envs.shielded_ego import ShieldedEgo
from dubins_traffic.errors import DubinsTrafficError, InputError
from dubins_traffic.record.reader import read
from dubins_traffic.runs.single import run_trial
from tests.environments import SHORT, single, weaving

RULED: dict[str, Any] = {
    **SHORT,
    "e-agents": [{"type": "lawful", "name": "car", "count": 3}],
    "duration": 12.0,
    "end_on_collision": False,
}
DISTURBED = {"position_noise": 0.02, "command_delay": 1, "command_loss": 0.1}


def driven(env: Any, seed: int = 3) -> tuple[list[Any], list[dict[str, Any]]]:
    """Drive an episode to and fro across the road; return actions and infos."""
    env.reset(seed=seed)
    actions: list[Any] = []
    infos: list[dict[str, Any]] = []
    over = False
    while not over:
        actions.append(weaving(len(actions)))
        *_, terminated, over, told = env.step(actions[-1])
        over |= terminated
        infos.append(told)
    return actions, infos


@pytest.mark.parametrize("skip", [1, 5])
@pytest.mark.parametrize("disturbances", [{}, DISTURBED], ids=["", "disturbed"])
def test_it_does_what_the_controller_does_under_the_shield(
    tmp_path: Path, skip: int, disturbances: dict[str, Any]
) -> None:
    env = ShieldedEgo(single({**RULED, "disturbances": disturbances}, frame_skip=skip), overtakes="never")
    actions, infos = driven(env)
    (ended,) = [told["outcome"] for told in infos if "outcome" in told]
    asked = Scripted(env.unwrapped.commands(np.array(actions)))
    shielded = run_trial(ended.instance, Shield(asked, overtakes="never"), record=tmp_path / "a.mcap", name="env")
    assert replace(shielded.score, record=None, time_to_begin_s=None) == ended.score
    assert sum(told["interventions"] for told in infos) == shielded.score.interventions > 10
    assert {told["interventions"] for told in infos} <= set(range(skip + 1))
    run_trial(ended.instance, Scripted(env.unwrapped.given), record=tmp_path / "b.mcap", name="env")
    one, other = (read(tmp_path / f"{name}.mcap").frames for name in "ab")
    assert np.array_equal(one.x, other.x)
    assert np.array_equal(one.c, other.c)
    if not disturbances:
        assert not any(told["costs"][name] for told in infos for name in told["costs"])


def test_episodes_before_the_shield_are_not_under_it() -> None:
    bare = single(RULED, frame_skip=5)
    _, infos = driven(bare)
    assert not any("interventions" in told for told in infos)
    assert any(sum(told["costs"].values()) for told in infos)
    with pytest.raises(DubinsTrafficError, match="not under a shield"):
        _ = bare.given
    _, infos = driven(ShieldedEgo(bare))
    assert not any(sum(told["costs"].values()) for told in infos)


def test_what_can_be_under_no_shield_is_said() -> None:
    with pytest.raises(InputError, match="a TrafficEnv"):
        ShieldedEgo(gymnasium.make("CartPole-v1"))
    with pytest.raises(InputError, match="overtakes"):
        ShieldedEgo(single(), overtakes="always")  # type: ignore[arg-type]
