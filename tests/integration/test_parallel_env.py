"""The environment for PettingZoo: its protocol, its seeds, who is blamed and paid, and that episodes can be cited."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence
from pettingzoo.test import api_test, parallel_api_test, parallel_seed_test
from pettingzoo.utils.conversions import parallel_to_aec

from dubins_traffic.cars.state import Frames
from dubins_traffic.envs.about_ego import NAMES
from dubins_traffic.envs.citing import cited
from dubins_traffic.envs.parallel import TrafficParallelEnv, parallel_env
from dubins_traffic.envs.shielded import Shielded, others
from dubins_traffic.envs.single import TrafficEnv
from dubins_traffic.envs.terms import LEAST, PEER
from dubins_traffic.errors import DubinsTrafficError, InputError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.sink import Ending
from dubins_traffic.runs.single import run_trial
from tests.integration.test_readme import ROOT, run_block, runnable


def config(cars: int = 3, seconds: float = 20.0, kind: str = "lawful") -> dict[str, Any]:
    return {
        "version": 1,
        "problem_domain": "dubins_traffic",
        "network": {"random": {"intersections": 7, "segments": 8}},
        "e-agents": [{"type": kind, "name": f"a{k}"} for k in range(cars)],
        "number_trials": 1,
        "duration": seconds,
        "number_goals_bounds": [1, 3],
        "rules": True,
    }


class Kept:
    """A sink that keeps frames."""

    def __init__(self) -> None:
        self.blocks: list[Frames] = []

    def begin(self, instance: Instance) -> None:
        pass

    def frames(self, frames: Frames) -> None:
        self.blocks.append(frames)

    def end(self, ending: Ending) -> None:
        pass

    def column(self, name: str) -> Floats:
        return np.concatenate([getattr(block, name) for block in self.blocks])


def driven(env: Any, seed: int, steps: int = 10**6, bias: float = 0.5) -> list[Any]:
    """Drive an episode at random, rather forward; return what each step has given, and poses, tick by tick."""
    chance = np.random.default_rng(seed)
    found: list[Any] = [env.reset(seed=seed)]
    cars = 1 + len(env.unwrapped.trial.e_agents)
    while env.agents and len(found) <= steps:
        actions = {name: np.clip(np.add(chance.uniform(-1.0, 1.0, 2), (bias, 0.0)), -1.0, 1.0) for name in env.agents}
        bank, row = env.unwrapped.fleet.seat(0)
        state = bank.group.state
        found.append((*env.step(actions), [array[row, :cars].copy() for array in state[:6]]))
    return found


@pytest.mark.parametrize(
    "more",
    [
        {},
        {"roles": "peers", "action": "discrete"},
        {"ego": "lanes"},
        {"ego": "rules", "learned": ["a1"], "frame_skip": 5},
    ],
)
@pytest.mark.path
def test_pettingzoo_finds_nothing_wrong_with_the_parallel_environment(more: dict[str, Any]) -> None:
    parallel_api_test(parallel_env(config(seconds=3.0), **more), 100)
    parallel_api_test(Shielded(parallel_env(config(seconds=3.0), **more)), 100)
    parallel_seed_test(lambda: parallel_env(config(seconds=3.0), **more), 80)


def test_pettingzoo_finds_nothing_wrong_with_the_environment_turn_by_turn() -> None:
    api_test(parallel_to_aec(parallel_env(config(seconds=2.0), render_mode="rgb_array")), 400)
    api_test(parallel_to_aec(Shielded(parallel_env(config(seconds=2.0), render_mode="rgb_array"))), 400)


@pytest.mark.parametrize("shielded", [False, True])
def test_equal_seeds_give_equal_streams_for_500_steps_and_in_the_next_episode(shielded: bool) -> None:
    streams: list[Any] = []
    for _ in range(2):
        env: Any = parallel_env(config(seconds=17.0))
        env = Shielded(env) if shielded else env
        streams.append([*driven(env, 4), env.reset(), env.reset(seed=4, options={"episode": 1})])
    assert len(streams[0]) > 500
    assert data_equivalence(streams[0][:-1], streams[1][:-1], exact=True)
    assert data_equivalence(streams[0][-2], streams[0][-1], exact=True), "the episode after the first"
    assert not data_equivalence(streams[0][0], streams[0][-1])


@pytest.mark.parametrize(
    "more",
    [{}, {"ego": "lanes"}, {"ego": "rules", "learned": ["a1"]}, {"frame_skip": 4, "learned": ["a0", "a2"]}],
)
@pytest.mark.parametrize("shielded", [False, True])
@pytest.mark.path
def test_run_trial_makes_the_frames_of_an_episode_again(more: dict[str, Any], shielded: bool) -> None:
    env: Any = parallel_env(config(seconds=12.0), **more)
    env = Shielded(env) if shielded else env
    found = driven(env, 7)
    inner: TrafficParallelEnv = env.unwrapped
    kept = Kept()
    result = run_trial(*cited(inner.trial, inner.commands), sinks=[kept])
    skip = more.get("frame_skip", 1)
    for k, name in enumerate(("x", "y", "c", "s", "speed", "yaw_rate")):
        again = kept.column(name)[skip::skip]
        mine = np.array([step[-1][k] for step in found[1:]])
        assert (again == mine).all(), name
    breaches = [(one.rule, one.tick) for one in result.score.verdict.violations] if result.score.verdict else []
    bank, row = inner.fleet.seat(0)
    assert {(one.rule, one.tick) for one in bank.group.breaches[row]} <= set(breaches)
    assert breaches or shielded


def test_a_shield_leaves_nothing_to_charge_and_says_when_it_steps_in() -> None:
    total = 0
    for seed in range(6):
        env = Shielded(parallel_env(config(cars=5, seconds=10.0)), overtakes="never")
        for _, _, _, _, infos, _ in driven(env, seed)[1:]:
            total += sum(info["interventions"] for info in infos.values())
            for name, info in infos.items():
                assert info["costs"].get("E1", 0.0) == info["costs"].get("E2", 0.0) == 0.0, name
                assert name != "ego_0" or not any(info["costs"].values())
    assert total > 500


def test_a_shield_on_one_side_leaves_the_other_alone() -> None:
    env: Any = Shielded(parallel_env(config(cars=4, seconds=25.0), learned=None), others(parallel_env(config(cars=4))))
    steps = driven(env, 1)[1:]
    assert all(("interventions" in info) == (name != "ego_0") for name, info in steps[0][4].items())
    assert sum(sum(step[4]["ego_0"]["costs"].values()) for step in steps) > 0
    assert steps[-1][4]["car_1"]["broke_first"] == "ego_0"


def test_a_shield_that_comes_later_holds_from_the_next_episode_on() -> None:
    """Also where next trials have been drawn ahead already; these stay the same trials."""
    env, plain = parallel_env(config(seconds=2.0)), parallel_env(config(seconds=2.0))
    for own in (env, plain):
        own.reset(seed=3)
        own.reset()
        own.step({})
    env.shield(env.possible_agents)
    for own in (env, plain):
        own.reset()
    assert env.trial == plain.trial
    assert "interventions" in env.step({})[4]["car_1"]
    told = [env.step(dict.fromkeys(env.agents, np.array([1.0, 1.0])))[4] for _ in range(40)]
    assert sum(info["interventions"] for infos in told for info in infos.values()) > 0


def test_e_agents_are_charged_until_the_ego_has_broken_its_part_and_the_ego_is_excused_after_them() -> None:
    env = parallel_env(config(cars=5, seconds=30.0), reward={"ego": {"debt": 0.0}})
    seen: set[tuple[str, bool]] = set()
    for seed in range(5):
        first = None
        for _, rewards, _, _, infos, _ in driven(env, seed)[1:]:
            now = infos["ego_0"]["broke_first"]
            costs = {name: sum(info["costs"].values()) for name, info in infos.items()}
            if first is not None:
                assert costs["ego_0"] == 0.0 or first == "ego_0"
                assert first != "ego_0" or all(costs[name] == 0.0 for name in costs if name != "ego_0")
            elif now is not None:
                assert costs[now] > 0.0
                seen.add((now, True))
            first = now
            for name, info in infos.items():
                assert rewards[name] == pytest.approx(sum(info["reward_terms"].values()))
                if name != "ego_0":
                    task = sum(infos["ego_0"]["reward_terms"][term] for term in ("visits", "rounds", "progress"))
                    assert info["reward_terms"]["spoiled"] == pytest.approx(-task)
    assert seen


def test_peers_go_round_the_goals_themselves() -> None:
    others = {"visits": 3.0, "E1": 0.0, "debt": 0.0}
    env = parallel_env(config(cars=2, seconds=40.0), roles="peers", reward={"others": others})
    steps = [step for seed in range(8) for step in driven(env, seed)[1:]]
    own = [step[4]["car_1"]["reward_terms"] for step in steps]
    assert set(own[0]) == set(PEER)
    assert sum(terms["visits"] for terms in own) % 3.0 == 0.0
    assert sum(terms["visits"] for terms in own) > 0.0
    assert all(terms["E1"] == 0.0 for terms in own)
    assert any(step[4]["car_1"]["costs"]["E1"] for step in steps)


def test_a_peer_in_debt_earns_less() -> None:
    """The same episodes, with debts and without."""
    paid: list[list[float]] = []
    for debt in (1.0, 0.0):
        env = parallel_env(
            config(cars=2, seconds=40.0), roles="peers", reward={"others": {"debt": debt}}, excuses=False
        )
        steps = [step for seed in range(4) for step in driven(env, seed)[1:]]
        paid.append([step[4]["car_1"]["reward_terms"]["progress"] for step in steps])
    shares = {round(owing / free, 6) for owing, free in zip(*paid, strict=True) if free}
    assert max(shares) == 1.0
    assert min(shares) == LEAST


def test_what_one_side_breaks_soon_after_the_other_is_forgiven() -> None:
    """The seconds of breaches that last, too; without excuses each side pays for all."""
    costs: dict[Any, tuple[float, float]] = {}
    for excuses in (True, "window", False):
        env = parallel_env(
            config(cars=5, seconds=30.0), excuses=excuses, reward={"ego": {"off_road_s": 1.0, "left_s": 1.0}}
        )
        infos = [step[4]["ego_0"] for seed in range(5) for step in driven(env, seed)[1:]]
        lasting = sum(info["reward_terms"][name] for info in infos for name in ("off_road_s", "left_s"))
        costs[excuses] = sum(info["cost"] for info in infos), lasting
    for part in (0, 1):
        assert costs[True][part] < costs["window"][part] < costs[False][part]


def test_agents_are_told_where_the_ego_is_and_goes() -> None:
    env = parallel_env(config())
    observations, _ = env.reset(seed=3)
    told = {name: dict(zip(NAMES, seen[-len(NAMES) :].tolist(), strict=True)) for name, seen in observations.items()}
    assert [own["is_ego"] for own in told.values()] == [1.0, 0.0, 0.0, 0.0]
    ego, other = env.trial.starts[0], env.trial.starts[2]
    dx, dy = ego.x - other.x, ego.y - other.y
    away = np.hypot(dx, dy)
    assert told["car_2"]["bearing_cos"] == pytest.approx((other.c * dx + other.s * dy) / away, abs=1e-5)
    assert told["car_2"]["bearing_sin"] == pytest.approx((other.c * dy - other.s * dx) / away, abs=1e-5)
    assert told["car_2"]["distance"] == pytest.approx(away / (away + env.trial.problem.sensing_radius), abs=1e-5)
    assert len({own["route"] for own in told.values()}) == 1
    assert told["ego_0"]["distance"] == 0.0


def test_pictures_of_an_episode_show_what_has_been_broken() -> None:
    env = parallel_env(config(seconds=8.0), render_mode="rgb_array", width=200, height=160)
    env.reset(seed=1)
    first = env.render()
    assert first is not None
    assert first.shape == (160, 200, 3)
    driven(env, 1)
    last = env.render()
    assert (last != first).any()
    env.close()


@pytest.mark.parametrize("ego", ["rules", "lanes"])
def test_an_egos_controller_is_disturbed_as_in_any_trial(ego: str) -> None:
    own = {**config(seconds=2.0), "disturbances": {"command_delay": 5}}
    late, prompt = parallel_env(own, ego=ego), parallel_env(config(seconds=2.0), ego=ego)
    for env in (late, prompt):
        env.reset(seed=1)
        for _ in range(6):
            env.step({})
    assert not late.commands[:5, 0].any()
    assert prompt.commands[0, 0].any()
    assert np.array_equal(late.commands[5, 0], prompt.commands[0, 0])


def test_what_makes_no_sense_is_named() -> None:
    with pytest.raises(InputError, match=r"roles: no such role: got 'friends'; expected adversaries or peers"):
        parallel_env(config(), roles="friends")
    with pytest.raises(InputError, match=r"reward.others: no such term.*'visits'.*spoiled"):
        parallel_env(config(), reward={"others": {"visits": 1.0}})
    with pytest.raises(InputError, match=r"learned: no such agent: got 'b'; expected a0, a1, a2"):
        parallel_env(config(), learned=["b"])
    with pytest.raises(InputError, match=r"learned: nobody learns"):
        parallel_env(config(), ego="rules", learned=[])
    with pytest.raises(
        InputError,
        match=r"e-agents: an e-agent beside learners: got 'wander'; expected chosen, lawful, nemesis",
    ):
        parallel_env(config(kind="wander"), learned=["a1"])
    with pytest.raises(InputError, match=r"disturbances: no agent"):
        parallel_env({**config(), "disturbances": {"command_delay": 1}})
    with pytest.raises(InputError, match=r"shield: no such agent: got 'car_9'"):
        Shielded(parallel_env(config()), ["car_9"])
    env = parallel_env(config(seconds=1.0))
    with pytest.raises(DubinsTrafficError, match="reset"):
        env.step({})
    env.reset(seed=1)
    with pytest.raises(InputError, match=r"action: no such agent: got 'ego'"):
        env.step({"ego": np.zeros(2)})
    with pytest.raises(InputError, match=r"action: not an action"):
        env.step({"ego_0": np.array([np.nan, 0.0])})


def test_environments_of_gymnasium_are_drawn_alike_one_by_one_and_many_at_once() -> None:
    one = gymnasium.make("dubins_traffic/Town-v0", render_mode="rgb_array")
    many = gymnasium.make_vec(
        "dubins_traffic/Town-v0", 3, "vector_entry_point", render_mode="rgb_array", width=240, height=200
    )
    one.reset(seed=5)
    many.reset(seed=5)
    (first, *more), alone = many.render() or (), one.render()
    assert isinstance(alone, np.ndarray)
    assert alone.shape == (400, 400, 3)
    assert first.shape == (200, 240, 3)
    assert len(more) == 2
    for _ in range(20):
        many.step(np.ones((3, 2), dtype=np.float32))
    assert ((many.render() or ())[0] != first).any()
    with pytest.raises(InputError, match=r"render_mode: no such mode: got 'ansi'"):
        TrafficEnv("town", render_mode="ansi")
    one.close()
    many.close()


def test_the_page_on_agents_runs(tmp_path: Path) -> None:
    blocks = runnable((ROOT / "docs" / "learning-agents.md").read_text(encoding="utf-8"))
    assert len(blocks) == 3
    for language, text in blocks:
        run_block(language, text, tmp_path)
    assert "episode.mcap" in {path.name for path in tmp_path.iterdir()}


def test_the_example_of_adversaries_drives_alike_again_and_breaks_nothing_of_e1_and_e2() -> None:
    spec = importlib.util.spec_from_file_location("adversaries", ROOT / "examples" / "learning" / "adversaries.py")
    assert spec is not None
    assert spec.loader is not None
    example: Any = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    first, again = (example.drive("lanes", [example.beginner()] * 3, 1, range(3)) for _ in range(2))
    assert all((first[name] == again[name]).all() for name in first)
    assert not first["broken"][:, :2].any()
    assert first["visits"].sum() > 0.0
