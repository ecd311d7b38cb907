"""Environments on roads that bend: what they show of lanes, against angles and trigonometry; episodes are the trials
that they cite; batches see what single environments see.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from dubins_traffic.controllers.scripted import Scripted
from dubins_traffic.learning.flat import FlatObserver
from dubins_traffic.problem.configuration import Configuration, load_config
from dubins_traffic.record.reader import read
from dubins_traffic.runs.single import run_trial
from tests.chain_reference import RING, SNAKE, Track
from tests.environments import single, vector

STEPS = 150


def _configured(network: Any = RING, **more: Any) -> Configuration:
    return load_config(
        {
            "version": 1, "problem_domain": "dubins_traffic", "rnd": network.to_document(), "rules": True,
            "e-agents": [{"type": "lawful", "name": "car", "count": 3}], "number_goals_bounds": [2, 2],
            "duration": 20, **more,
        }
    )  # fmt: skip


def _along_the_road(seen: Any, track: Track, back: bool) -> Any:
    """Return an action that follows the middle of a right lane, roughly."""
    foot = track.foot(seen.pose.x, seen.pose.y)
    way = -foot.way if back else foot.way
    left = (-foot.left if back else foot.left) + 0.3
    sine = (way.conjugate() * complex(seen.pose.c, seen.pose.s)).imag
    return np.array([0.8, np.clip(-1.5 * sine - 1.0 * left, -1.0, 1.0)], dtype=np.float32)


@pytest.mark.parametrize("network", [RING, SNAKE], ids=["ring", "snake"])
def test_what_is_shown_of_lanes_is_measured_along_the_curves(network: Any) -> None:
    tracks = [Track(network, s) for s in range(len(network.segments))]
    env = single(_configured(network), observation="object")
    on_curves, worst = 0, 0.0
    for seed in range(4):
        seen, info = env.reset(seed=seed)
        observe = FlatObserver(info["trial"].problem)
        parts = observe.layout.parts
        for _ in range(STEPS):
            lane = seen.propositions.lane
            shown = observe(seen)[parts["lane"]]
            if lane < 0:
                seen = env.step(np.array([0.9, 0.0], dtype=np.float32))[0]
                continue
            track = tracks[lane >> 1]
            foot = track.foot(seen.pose.x, seen.pose.y)
            along = track.length - foot.along if lane & 1 else foot.along
            left = -foot.left if lane & 1 else foot.left
            turned = (-foot.way if lane & 1 else foot.way).conjugate() * complex(seen.pose.c, seen.pose.s)
            end = max(track.length - along, 0.0)
            expected = [left / 0.6, turned.real, turned.imag, along / track.length, 1.0 - 1.0 / (end + 1.0)]
            worst = max(worst, float(np.abs(np.clip(expected, -1.0, 1.0) - shown[1:]).max()))
            on_curves += bool(network.bent[lane >> 1]) and 1.6 < along < track.length - 1.6
            seen = env.step(_along_the_road(seen, track, bool(lane & 1)))[0]
    assert worst < 1e-6
    assert on_curves > 50


def test_the_way_to_a_goal_falls_by_what_is_driven_along_the_curves() -> None:
    env = single(_configured(**{"e-agents": []}), observation="object")
    compared = 0
    for seed in range(6):
        seen, info = env.reset(seed=seed)
        observe = FlatObserver(info["trial"].problem)
        place = observe.layout.names.index("goal.route")
        before = None
        for _ in range(STEPS):
            share = float(observe(seen)[place])
            lane = seen.propositions.lane
            track = Track(RING, max(lane, 0) >> 1)
            foot = track.foot(seen.pose.x, seen.pose.y)
            along = track.length - foot.along if lane & 1 else foot.along
            route = 5.0 / (1.0 - share) - 5.0
            if before is not None and before[0] == lane >= 0 and abs(route - before[1]) < 0.5:
                assert before[1] - route == pytest.approx(along - before[2], abs=1e-4)
                compared += 1
            before = lane, route, along
            seen = env.step(_along_the_road(seen, track, bool(lane & 1)))[0]
    assert compared > 200


def test_an_episode_on_curves_is_the_trial_that_it_cites(tmp_path: Path) -> None:
    config = _configured(network=RING, **{"e-agents": [{"type": "lawful", "name": "car", "count": 2}], "duration": 8})
    env = vector(2, config, autoreset_mode=AutoresetMode.DISABLED)
    seen, info = env.reset(seed=3)
    instance = info["trial"][1]
    seens, actions, over = [seen[1]], [], False
    while not over:
        actions.append(np.array([0.9, 0.4 * np.sin(0.07 * len(actions))], dtype=np.float32))
        seen, _, _, truncated, info = env.step(np.stack([actions[-1]] * 2))
        over = truncated[1]
        seens.append(seen[1])
    observe, told = FlatObserver(instance.problem), list[Any]()

    class Watching(Scripted):
        def act(self, observation: Any) -> Any:
            told.append(observe(observation))
            return super().act(observation)

    path = tmp_path / "one.mcap"
    result = run_trial(instance, Watching(env.commands(np.array(actions))), record=path, name="env")
    assert replace(result.score, record=None, time_to_begin_s=None) == info["outcome"][1].score
    assert len(told) == len(seens) - 1 == read(path).frames.x.shape[0] - 1
    assert all(np.array_equal(one, other) for one, other in zip(told, seens, strict=False))
