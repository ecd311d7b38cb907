"""Policies in ONNX: they act as the same network in our format, and what is none is refused by name."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from onnx import TensorProto, helper

from dubins_traffic import draw, load_config, run_trial
from dubins_traffic.errors import InputError
from dubins_traffic.learning.onnx_policy import MOST, OnnxPolicy
from dubins_traffic.learning.policy import CHOICES, Learned, Policy, load
from tests.onnx_models import exported, product, written

ROOT = Path(__file__).parents[2]
POLICIES = ROOT / "examples" / "learning"


def random_policy(rng: np.random.Generator, rows: int, choices: np.ndarray) -> Policy:
    widths = (5, 7, 6, rows)
    layers = tuple((rng.normal(size=(after, before)), rng.normal(size=after)) for before, after in pairwise(widths))
    names = ("own.speed", "lane.offset", "lane.heading_sin", "goal.bearing_sin", "crossing.x")
    return Policy(names, 3, 2, layers, choices)


@pytest.mark.parametrize(("rows", "choices"), [(2, np.zeros((0, 2))), (15, CHOICES), (3, CHOICES[2:5])])
def test_it_acts_as_the_same_network_in_our_format(tmp_path: Path, rows: int, choices: np.ndarray) -> None:
    rng = np.random.default_rng(rows)
    for _ in range(5):
        ours = random_policy(rng, rows, choices)
        theirs = OnnxPolicy(exported(ours, tmp_path / "policy.onnx"))
        assert (theirs.names, theirs.inputs, theirs.cars, theirs.frame_skip) == (ours.names, 5, 3, 2)
        for seen in rng.uniform(-1.0, 1.0, (20, 5)).astype(np.float32):
            np.testing.assert_allclose(theirs.act(seen), ours.act(seen), atol=1e-6)


def test_an_example_drives_as_in_our_format(tmp_path: Path) -> None:
    policy = load(POLICIES / "district.npz")
    instance = draw(load_config(str(POLICIES / "district.json")), 1000)
    here = run_trial(instance, Learned(policy))
    there = run_trial(instance, Learned(OnnxPolicy(exported(policy, tmp_path / "policy.onnx"))))
    assert here.score.rounds == there.score.rounds > 0
    assert here.score.goals_visited == there.score.goals_visited
    assert here.score.driven.distance_m == pytest.approx(there.score.driven.distance_m, rel=1e-4)


def test_it_may_name_nothing_and_return_the_number_of_an_action(tmp_path: Path) -> None:
    nodes = [
        helper.make_node("MatMul", ["seen", "w"], ["sums"]),
        helper.make_node("ArgMax", ["sums"], ["action"], axis=1, keepdims=0),
    ]
    weights = np.zeros((4, 15))
    weights[2, 7] = 1.0
    policy = OnnxPolicy(written(tmp_path / "policy.onnx", nodes, {"w": weights}, width=4, returns=TensorProto.INT64))
    assert (policy.names, policy.cars, policy.frame_skip) == ((), 5, 1)
    assert policy.act(np.array([0.0, 0.0, 1.0, 0.0])).tolist() == CHOICES[7].tolist()
    assert policy.act(np.array([0.0, 0.0, -1.0, 0.0])).tolist() == CHOICES[0].tolist()


def test_what_is_larger_than_a_share_is_clipped(tmp_path: Path) -> None:
    node = helper.make_node("MatMul", ["seen", "w"], ["action"])
    policy = OnnxPolicy(written(tmp_path / "p.onnx", [node], {"w": [[3.0, -0.5]]}, width=1))
    assert policy.act(np.ones(1)).tolist() == [1.0, -0.5]


def test_a_model_that_draws_random_numbers_draws_the_same_again(tmp_path: Path) -> None:
    node = helper.make_node("RandomUniformLike", ["seen"], ["action"], high=1.0, low=-1.0)
    path = written(tmp_path / "p.onnx", [node], {}, width=2)
    first, again = ([policy.act(np.zeros(2)).tolist() for _ in range(3)] for policy in map(OnnxPolicy, (path, path)))
    assert first == again
    assert first[0] != first[1]


def test_what_does_not_fit_the_observation_is_refused_at_the_start(tmp_path: Path) -> None:
    problem = draw(load_config("junction"), 1).problem
    policy = Learned(OnnxPolicy(product(tmp_path / "p.onnx", 7, 2)))
    with pytest.raises(InputError, match=r"input: does not fit: got 7; expected \d+ numbers"):
        policy.start(problem)


def refused(path: Path, says: str) -> None:
    with pytest.raises(InputError, match=says) as found:
        OnnxPolicy(path)
    assert str(found.value).startswith(str(path))


def test_what_is_no_policy_is_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "p.onnx"
    refused(path, "no such file")
    path.write_bytes(b"\x08\x09 nothing that anybody could read" * 9)
    refused(path, "can't be read")
    path.write_bytes(b"")
    refused(path, "can't be run")
    with path.open("r+b") as stream:
        stream.truncate(MOST + 1)
    refused(path, f"too large: got {MOST + 1}")
    refused(product(path, 4, 3), "output: not an action: got .* two numbers, 15 numbers")
    refused(product(path, 4, 2, properties={"frame_skip": 0}), "frame_skip: not a number: got '0'")
    refused(product(path, 4, 2, properties={"names": "[1]"}), "names: not names")
    refused(product(path, 4, 2, properties={"names": "own.speed"}), "names: not a list")
    for wrong in ("[[0.0, 2.0]]", "[0.0]", "[[]]", '["left"]', "[[1.0, NaN]]"):
        refused(product(path, 4, 2, properties={"choices": wrong}), "choices: not choices")
    node = helper.make_node("MatMul", ["seen", "w"], ["action"])
    refused(written(path, [node], {"w": np.zeros((4, 2))}, width="any"), "seen: does not fit")
    reshaped = helper.make_node("MatMul", ["w", "seen"], ["action"])
    refused(written(path, [reshaped], {"w": np.zeros((2, 9))}, width=4), "model: fails|can't be run")


def test_data_in_another_file_is_refused(tmp_path: Path) -> None:
    """Such a file could be any that the process may read."""
    refused(product(tmp_path / "p.onnx", 400, 2, apart=True), "w: keeps data in another file")


def test_operators_that_are_not_of_onnx_are_refused_wherever_they_stand(tmp_path: Path) -> None:
    path, boom = tmp_path / "p.onnx", helper.make_node("Boom", ["seen"], ["action"], domain="my.ops")
    refused(
        written(path, [boom], {}, width=2, domains=["my.ops"]),
        "node: not an operator of ONNX: got 'my.ops.Boom'",
    )
    inner = helper.make_graph([boom], "inner", [], [helper.make_tensor_value_info("action", 1, None)])
    nodes = [
        helper.make_node("ReduceSum", ["seen"], ["sum"], keepdims=0),
        helper.make_node("Cast", ["sum"], ["which"], to=9),
        helper.make_node("If", ["which"], ["action"], then_branch=inner, else_branch=inner),
    ]
    refused(written(path, nodes, {}, width=2, domains=["my.ops"]), "my.ops.Boom")
