"""What an environment sees does not depend on how many there are, and is what the trial by itself is, to the bit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from dubins_traffic import load_config
from dubins_traffic.cars.state import Observation
from dubins_traffic.controllers.scripted import Scripted
from dubins_traffic.learning.flat import FlatObserver
from dubins_traffic.problem.instance import Problem
from dubins_traffic.record.reader import read
from dubins_traffic.runs.single import run_trial
from tests.environments import SHORT, single, vector, weaving

STEPS = 200
NOISE = {"position_noise": 0.05, "heading_noise": 0.1}
LATE = {"command_delay": 3, "command_loss": 0.2}


def streams(envs: int, watched: list[int], mode: AutoresetMode, **given: Any) -> dict[int, list[Any]]:
    """Return all that some of so many environments are told, step by step."""
    env = vector(envs, autoreset_mode=mode, **given)
    seen, info = env.reset(seed=11)
    found: dict[int, list[Any]] = {k: [(seen[k].tobytes(), info["trial"][k].trial)] for k in watched}
    over = np.zeros(envs, dtype=bool)
    for step in range(STEPS):
        if mode is AutoresetMode.DISABLED and over.any():
            seen, info = env.reset(options={"reset_mask": over})
            for k in np.flatnonzero(over & np.isin(np.arange(envs), watched)).tolist():
                found[k].append((seen[k].tobytes(), info["trial"][k].trial))
        seen, reward, terminated, truncated, info = env.step(np.stack([weaving(step, k) for k in range(envs)]))
        over = terminated | truncated
        for k in watched:
            terms = info["reward_terms"][k].tobytes()
            own = [seen[k].tobytes(), reward[k], terms, terminated[k], truncated[k]]
            if "trial" in info and info["_trial"][k]:
                own.append(info["trial"][k].trial)
            if "final_obs" in info and info["_final_obs"][k]:
                own += [info["final_obs"][k].tobytes(), info["final_info"]["outcome"][k].score]
            found[k].append(own)
    return found


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_streams_do_not_depend_on_how_many_environments_there_are(mode: AutoresetMode) -> None:
    few, many = streams(7, [0, 3, 6], mode), streams(64, [0, 3, 6], mode)
    assert streams(1, [0], mode)[0] == few[0]
    assert few == many
    assert sum(own[3] or own[4] for k in few for own in few[k][1:] if len(own) > 2) >= 6


def test_streams_of_disturbed_environments_do_not_depend_on_how_many_there_are() -> None:
    config = {**SHORT, "disturbances": NOISE | LATE}
    few = streams(1, [0], AutoresetMode.SAME_STEP, config=config, frame_skip=2)
    many = streams(5, [0, 4], AutoresetMode.SAME_STEP, config=config, frame_skip=2)
    assert few[0] == many[0] != many[4]
    assert few[0] != streams(1, [0], AutoresetMode.SAME_STEP, frame_skip=2)[0]


@pytest.mark.parametrize("disturbances", [{}, NOISE | LATE], ids=["", "disturbed"])
def test_a_single_environment_is_the_first_of_many(disturbances: dict[str, Any]) -> None:
    config = {**SHORT, "disturbances": disturbances}
    alone, told = single(config), vector(3, config, autoreset_mode=AutoresetMode.SAME_STEP)
    first, info = alone.reset(seed=11)
    seen, infos = told.reset(seed=11)
    assert np.array_equal(first, seen[0])
    for step in range(STEPS):
        first, reward, terminated, truncated, info = alone.step(weaving(step))
        seen, rewards, ended, cut, infos = told.step(np.stack([weaving(step, k) for k in range(3)]))
        assert (reward, terminated, truncated) == (rewards[0], ended[0], cut[0])
        if terminated or truncated:
            assert np.array_equal(first, infos["final_obs"][0])
            assert info["outcome"] == infos["final_info"]["outcome"][0]
            first, info = alone.reset()
        assert np.array_equal(first, seen[0])


def test_the_same_seed_gives_the_same_500_steps() -> None:
    def stream(seed: int) -> list[Any]:
        env = vector(2, load_config("demo"))
        found = [env.reset(seed=seed)[0].tobytes()]
        for step in range(500):
            seen, reward, *_ = env.step(np.stack([weaving(step, k) for k in range(2)]))
            found.append((seen.tobytes(), reward.tobytes()))
        return found

    once = stream(21)
    assert once == stream(21)
    assert once != stream(22)


class Watching(Scripted):
    """Plays commands, and makes the flat observation of what it is told."""

    seen: list[bytes]

    def start(self, problem: Problem) -> None:
        self._observe = FlatObserver(problem)
        self.seen = []

    def act(self, observation: Observation) -> Any:
        self.seen.append(self._observe(observation).tobytes())
        return super().act(observation)


@pytest.mark.parametrize("skip", [1, 4])
@pytest.mark.parametrize("laser", [False, True])
@pytest.mark.parametrize("disturbances", [{}, NOISE, LATE, NOISE | LATE], ids=["", "noise", "late", "both"])
def test_an_episode_is_the_trial_that_it_cites(
    tmp_path: Path, skip: int, laser: bool, disturbances: dict[str, Any]
) -> None:
    """Frames, labels, commands, score and flat observations; two records made of it are equal byte for byte."""
    config = {
        **SHORT,
        "disturbances": disturbances,
        "duration": 8.0 if disturbances else 20.0,
        "end_on_collision": False,
        "laser": laser and {"rays": 16, "rate": 7.0},
    }
    env = vector(2, config, frame_skip=skip, autoreset_mode=AutoresetMode.DISABLED)
    seen, info = env.reset(seed=3)
    instance, actions, seens, frames = info["trial"][1], [], [seen[1].tobytes()], []
    bank, row = env.fleet.seat(1)
    over = False
    while not over:
        actions.append(weaving(len(actions), 1))
        seen, _, _, truncated, info = env.step(np.stack([weaving(len(actions) - 1, k) for k in range(2)]))
        over = truncated[1]
        seens.append(seen[1].tobytes())
        state, labels = bank.group.state, bank.group.labels
        frames.append([array[row].copy() for array in (*state[:6], *labels)])
    records = [tmp_path / "one.mcap", tmp_path / "two.mcap"]
    for path in records:
        player = Watching(env.commands(np.array(actions)))
        result = run_trial(instance, player, record=path, name="env")
    assert records[0].read_bytes() == records[1].read_bytes()
    assert replace(result.score, record=None, time_to_begin_s=None) == info["outcome"][1].score
    told = read(records[0]).frames
    for place, name in enumerate(("x", "y", "c", "s", "speed", "yaw_rate", "segment", "at", "crosses", "lane", "bits")):
        assert np.array_equal(getattr(told, name)[skip::skip], np.array([own[place] for own in frames])), name
    assert player.seen[::skip] == seens[:-1]


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_staggered_environments_run_the_same_trials_and_end_at_different_times(mode: AutoresetMode) -> None:
    """The first episode is that of before up to where it is cut, and the second is the next trial, whole."""
    plain, few, many = (vector(envs, autoreset_mode=mode, staggered=own) for envs, own in
                        ((20, False), (5, True), (20, True)))  # fmt: skip
    seen = [env.reset(seed=11)[0] for env in (plain, few, many)]
    assert np.array_equal(seen[0], seen[2])
    first, cut_at = np.ones(20, dtype=bool), np.full(20, -1)
    for step in range(STEPS):
        actions = np.stack([weaving(step, k) for k in range(20)])
        if mode is AutoresetMode.DISABLED:
            for env, envs in ((plain, 20), (few, 5), (many, 20)):
                if env.fleet.ended.any():
                    env.reset(options={"reset_mask": env.fleet.ended[:envs].copy()})
        own = plain.step(actions)
        part, whole = few.step(actions[:5]), many.step(actions)
        for k in range(4):
            assert np.array_equal(part[k], whole[k][:5])
        over = whole[2] | whole[3]
        same = first & ~(over & (own[2] | own[3] | over)) & ~(own[2] | own[3])
        assert np.array_equal(own[1][same], whole[1][same])
        assert np.array_equal(own[0][same], whole[0][same])
        for k in np.flatnonzero(over & first):
            ended = whole[4]["final_info"] if mode is AutoresetMode.SAME_STEP else whole[4]
            is_cut = not (own[2] | own[3])[k]
            assert is_cut == ("outcome" not in ended or ended["outcome"][k] is None)
            assert not is_cut or (whole[3][k] and not whole[2][k])
            cut_at[k] = step
        first &= ~(over | own[2] | own[3])
    assert len(set(cut_at.tolist())) >= 12
    assert [many.fleet.instance(k).trial % 4096 for k in range(20)] == list(range(20))
    assert min(many.fleet.instance(k).trial for k in range(20)) >= 4096
