"""What environments tell, refuse, and end with."""

from __future__ import annotations

import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

from dubins_traffic import load_config
from dubins_traffic.cars.state import Observation
from dubins_traffic.controllers.scripted import Scripted
from dubins_traffic.envs import NAMES
from dubins_traffic.envs.episodes import Episodes, Levels
from dubins_traffic.envs.parallel import TrafficParallelEnv
from dubins_traffic.envs.record_video import RecordVideo
from dubins_traffic.envs.terms import COSTS, TERMS
from dubins_traffic.errors import DubinsTrafficError, InputError
from dubins_traffic.learning.flat import FlatObserver
from dubins_traffic.runs.single import run_trial
from dubins_traffic.verification.worlds import with_formulas
from tests.environments import SHORT, single, vector, weaving
from tests.unit.test_animate import video_library

OTHERS: dict[str, Any] = {"observation": "dict", "action": "discrete", "frame_skip": 3}


@pytest.mark.parametrize("given", [{}, OTHERS], ids=["flat", "dict"])
@pytest.mark.parametrize("name", sorted(NAMES))
def test_gymnasiums_checker_finds_nothing(name: str, given: dict[str, Any]) -> None:
    own = {"config": SHORT} if name.endswith("Traffic-v0") else {}
    check_env(gymnasium.make(name, **own, **given).unwrapped)


def test_the_names_are_known_without_an_import_of_ours() -> None:
    made = [
        "make('dubins_traffic.envs:dubins_traffic/Demo-v0')",
        "make_vec('dubins_traffic.envs:dubins_traffic/Demo-v0', vectorization_mode='vector_entry_point')",
    ]
    code = f"import gymnasium; gymnasium.{made[0]}.reset(seed=1); gymnasium.{made[1]}.reset(seed=1); print('made')"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert ran.stdout.strip() == "made", ran.stderr


def test_terms_and_costs_are_what_the_score_counts() -> None:
    config = {
        **SHORT,
        "duration": 20.0,
        "end_on_collision": False,
        "e-agents": [{"type": "wander", "count": 9}],
    }
    reward = dict.fromkeys(TERMS, 1.0) | {"debt": 0.0}
    env = vector(8, config, frame_skip=4, autoreset_mode=AutoresetMode.DISABLED, reward=reward)
    env.reset(seed=4)
    terms, costs, over, step = (
        np.zeros((len(TERMS), 8)),
        np.zeros((len(COSTS), 8)),
        np.zeros(8, dtype=bool),
        0,
    )
    while not over.any():
        _, reward, _, over, info = env.step(np.stack([weaving(step, k) for k in range(8)]))
        own = np.array([info["reward_terms"][name] for name in TERMS])
        assert reward == pytest.approx(own.sum(axis=0))
        terms += own
        counted = np.array([info["costs"][name] for name in COSTS])
        assert info["cost"].tolist() == counted[[name != "1.collision" for name in COSTS]].sum(axis=0).tolist()
        costs += counted
        step += 1
    assert over.all()
    for k, outcome in enumerate(info["outcome"]):
        score = outcome.score
        found = Counter(own.rule for own in score.verdict.violations if own.car == "ego")
        assert [costs[j, k] for j in range(len(COSTS) - 1)] == [found.get(name, 0) for name in COSTS[:-1]]
        assert costs[-1, k] == sum(own.at_fault for own in score.collisions)
        assert terms[TERMS.index("visits"), k] == sum(goal.visits for goal in score.goals)
        assert terms[TERMS.index("rounds_before_breach"), k] == pytest.approx(score.rounds_before_breach)
        assert terms[TERMS.index("off_road_s"), k] == pytest.approx(score.driven.off_road_s)
    assert costs.sum(axis=1)[[0, 1, 2, -1]].all()
    assert terms[TERMS.index("visits")].sum() > 0


def test_weights_count_and_wrong_ones_are_refused() -> None:
    env = single(reward=dict.fromkeys(TERMS, 0.0) | {"time": 2.0}, frame_skip=15)
    env.reset(seed=1)
    assert env.step(weaving(0))[1] == pytest.approx(1.0)
    for wrong in ({"speed": 1.0}, {"visits": float("nan")}, "rounds"):
        with pytest.raises(InputError, match="reward"):
            single(reward=wrong)


@pytest.mark.parametrize(
    "given",
    [
        {"observation": "pixels"}, {"action": "joystick"}, {"frame_skip": 0}, {"cars": -1}, {"levels": 0},
        {"levels": {"count": 2, "split": "all"}}, {"config": {**SHORT, "formulas": {"own": "[] !left_ego"}}},
    ],
)  # fmt: skip
def test_what_can_not_be_is_refused(given: dict[str, Any]) -> None:
    with pytest.raises(InputError):
        single(**given)


def test_the_order_of_calls_is_kept() -> None:
    env = single()
    with pytest.raises(DubinsTrafficError, match="reset"):
        env.step(weaving(0))
    env.reset(seed=1)
    with pytest.raises(InputError, match="action"):
        env.step(np.array([np.nan, 0.0]))
    with pytest.raises(DubinsTrafficError, match="reset"):
        vector(2, autoreset_mode=AutoresetMode.DISABLED).step(np.zeros((2, 2)))
    with pytest.raises(InputError, match="observation"):
        vector(2, observation="object")


def test_a_collision_terminates_and_the_end_of_time_truncates() -> None:
    env = vector(12, autoreset_mode=AutoresetMode.SAME_STEP)
    env.reset(seed=2)
    ends = Counter[str]()
    for step in range(100):
        *_, terminated, truncated, info = env.step(np.stack([weaving(step, k) for k in range(12)]))
        assert not (terminated & truncated).any()
        for k in np.flatnonzero(terminated | truncated):
            end = str(info["final_info"]["outcome"][k].ending.end)
            assert end == ("collision" if terminated[k] else "duration")
            ends[end] += 1
    assert ends["duration"] > 0
    assert ends["collision"] > 0


def test_levels_are_drawn_once_and_those_to_test_on_are_others() -> None:
    town = load_config("town")
    sets: list[set[int]] = []
    lines: list[set[Any]] = []
    for split in ("train", "test"):
        episodes = Episodes(town, Levels(3, seed=5, split=split))
        drawn = episodes.draw([(1, env, k) for env in range(8) for k in range(2)])
        sets.append({id(instance.problem.network) for instance in drawn})
        lines.append({instance.problem.network.segments for instance in drawn})
        assert len(sets[-1]) == 3
        assert len({instance.starts for instance in drawn}) == 16
    assert not lines[0] & lines[1]


def test_an_observation_can_be_that_of_a_controller() -> None:
    env = single({**SHORT, "laser": {"rays": 8, "rate": 7.0}}, observation="object", frame_skip=2)
    flat = single({**SHORT, "laser": {"rays": 8, "rate": 7.0}}, frame_skip=2)
    seen, info = env.reset(seed=6)
    vector, _ = flat.reset(seed=6)
    assert isinstance(seen, Observation)
    observe = FlatObserver(info["trial"].problem)
    for step in range(20):
        parts = flat.settings.layout.parts
        assert np.array_equal(np.clip(seen.scan / 5.0, 0.0, 1.0).astype(np.float32), vector[parts["laser"]])
        assert np.array_equal(observe(seen)[parts["cars"]], vector[parts["cars"]])
        seen, vector = env.step(weaving(step))[0], flat.step(weaving(step))[0]


def test_an_episode_can_be_chosen_and_cited() -> None:
    env = single()
    first, info = env.reset(seed=8, options={"episode": 2})
    instance = info["trial"]
    assert (instance.seed, instance.trial) == (8, 2 * 4096)
    again = single()
    again.reset(seed=8)
    again.reset()
    third, _ = again.reset()
    assert np.array_equal(first, third)
    result = run_trial(instance, Scripted(env.commands([weaving(step) for step in range(400)])))
    assert result.instance is instance


def test_states_of_formulas_are_what_a_trial_that_carries_them_is_told() -> None:
    formulas = {
        "keeps right": "[] !left_ego",
        "goes on": "[] (still_ego -> <>[0,1] !still_ego)",
        "leaves": "<> in_crossing_ego",
    }
    config = {**SHORT, "duration": 15.0, "end_on_collision": False}
    env, alone = vector(3, config, frame_skip=4, formulas=formulas), single(config, formulas=formulas)
    _, info = env.reset(seed=9)
    instance, actions, over, states = info["trial"][0], [], np.zeros(3, dtype=bool), []
    while not over[0]:
        actions.append(weaving(len(actions)))
        _, _, _, over, info = env.step(np.stack([actions[-1]] * 3))
        states.append({name: str(info["formulas"][name][0]) for name in formulas})
    carrying = with_formulas(instance, formulas)
    result = run_trial(carrying, Scripted(env.commands(np.array(actions))))
    assert {one.name: one.verdict for one in result.score.formulas} == states[-1]
    assert len({tuple(own.values()) for own in states}) > 1
    _, info = alone.reset(seed=9)
    for step, action in enumerate(actions):
        for _ in range(4):
            *_, info = alone.step(action)
        assert info["formulas"] == states[step]
        if step == len(actions) - 2:
            break
    assert not instance.problem.formulas
    with pytest.raises(InputError, match="colour"):
        single(formulas={"own": "[] colour"})


def test_who_is_hit_while_it_stands_is_not_at_fault() -> None:
    """A scripted car drives straight into the ego, which stands before it; then the ego drives into a parked one."""
    script = {
        "type": "scripted",
        "parameters": {"commands": [[5.0, 0.5, 0.0]], "repeat": True},
        "start": [1, 6, 0],
    }
    parked = {"type": "parked", "parameters": {"vacates_after": None}, "start": [4.5, 6, 0]}
    for agent, speed, fault in ((script, 0.0, 0.0), (parked, 1.0, 1.0)):
        config = {**SHORT, "e-agents": [agent], "ego": {"start": [3, 6, 0]}, "duration": 10.0}
        env = single(config)
        env.reset(seed=1)
        terminated = False
        while not terminated:
            *_, terminated, truncated, info = env.step(np.array([speed, 0.0]))
            assert not truncated
        assert (info["costs"]["1.collision"], info["costs"]["at_fault"]) == (1.0, fault)
        others = sum(info["costs"][name] for name in COSTS if name not in ("1.collision", "at_fault"))
        assert info["cost"] == others + fault
        (collision,) = info["outcome"].score.collisions
        assert collision.at_fault == bool(fault)


NO_ACTIONS = (0.5, [0.5], [0.5, 0.5, 0.5], [[0.5, 0.5]], [0.5, [0.5]], None, {})
"""Values that are no element of the space of continuous actions."""


@pytest.mark.parametrize("action", NO_ACTIONS)
def test_an_action_of_another_shape_is_refused(action: Any) -> None:
    one, many = single(), vector(2)
    agents = TrafficParallelEnv({**SHORT, "e-agents": []})
    for env in (one, many, agents):
        env.reset(seed=1)
    before = one.fleet.board.arrays["asked"].copy()
    with pytest.raises(InputError, match=r"action: not an action.*Box, shape \(2,\), for each of 1"):
        one.step(action)
    with pytest.raises(InputError, match=r"action: not an action.*Box, shape \(2,\), for each of 2"):
        many.step(action)
    with pytest.raises(InputError, match=r"action: not an action.*Box, shape \(2,\), for each of 1"):
        agents.step({"ego_0": action})
    assert (one.fleet.board.arrays["asked"] == before).all()
    assert one.step([0.5, 0.5])[4]["costs"]


@pytest.mark.parametrize("actions", [(step for step in range(2)), {0.5}, object(), np.array(0.5), "up"])
def test_commands_are_asked_of_a_sequence_of_actions(actions: Any) -> None:
    with pytest.raises(InputError, match=r"action: not an action"):
        single().commands(actions)


@pytest.mark.parametrize("action", [[3], 0.5, None, [[1]]])
def test_a_discrete_action_of_another_shape_is_refused(action: Any) -> None:
    one, many = single(action="discrete"), vector(1, action="discrete")
    one.reset(seed=1)
    many.reset(seed=1)
    with pytest.raises(InputError, match=r"action: not an action"):
        one.step(action)
    if action != [3]:
        with pytest.raises(InputError, match=r"action: not an action"):
            many.step(action)


@pytest.mark.tools
def test_videos_show_the_episodes_that_are_wanted(tmp_path: Path) -> None:
    av = video_library()
    own = gymnasium.make("dubins_traffic/Town-v0", render_mode="rgb_array", width=121, height=80)
    env = RecordVideo(own, tmp_path / "videos", episode_trigger=lambda k: k != 1)
    painted: list[Any] = []
    for episode in range(3):
        env.reset(seed=1)
        painted = [own.render()]
        for _ in range(20):
            env.step(env.action_space.sample())
            painted.append(own.render())
        there = {path.name for path in (tmp_path / "videos").iterdir()}
        assert ("rl-video-episode-0.mp4" in there) == (episode > 0)
    env.close()
    assert sorted(path.name for path in (tmp_path / "videos").iterdir()) == [
        "rl-video-episode-0.mp4",
        "rl-video-episode-2.mp4",
    ]
    with av.open(str(tmp_path / "videos" / "rl-video-episode-2.mp4")) as file:
        assert file.streams.video[0].average_rate == own.metadata["render_fps"]
        seen = [frame.to_ndarray(format="rgb24").astype(int) for frame in file.decode(video=0)]
    assert len(seen) == len(painted) == 21
    for image, found in zip(painted, seen, strict=True):
        assert np.abs(np.asarray(image)[:, :120].astype(int) - found).mean() < 8.0
    assert (np.asarray(painted[0]) != np.asarray(painted[-1])).any()


def test_an_environment_that_paints_nothing_has_no_video(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="render_mode: nothing to record: got None; expected rgb_array"):
        RecordVideo(gymnasium.make("dubins_traffic/Town-v0"), tmp_path / "videos")
    assert not (tmp_path / "videos").exists()
