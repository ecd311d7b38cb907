"""The page on learning, and the example that learns: what it promises, and that its curve comes again."""

from __future__ import annotations

import csv
import importlib.util
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dubins_traffic import load_config, run_batch
from dubins_traffic.controllers import registry
from dubins_traffic.errors import InputError
from dubins_traffic.learning.flat import Layout
from dubins_traffic.learning.policy import Learned, Policy, load
from dubins_traffic.scoring.score import Score
from tests.minute import a_minute

pytestmark = pytest.mark.path

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "learning"
PAGE = ROOT / "docs" / "learning.md"


def test_the_page_names_all_that_stands_in_an_observation() -> None:
    page = PAGE.read_text(encoding="utf-8")
    table = page[page.index("| part | holds |") : page.index("Metres without a bound")]
    for name in Layout(1, 0).names:
        word = name.split(".")[-1]
        assert f"`{word}`" in table or word in ("speed", "yaw_rate", "left") or name.startswith(("own.", "cars[0]."))


def driven(name: str, controller: str, trials: int) -> list[Score]:
    """Return the scores of a controller in trials that nobody has learned from."""
    done = run_batch(load_config(str(EXAMPLE / f"{name}.json")), controller, trials=trials, seed=1000)
    return [outcome.score for outcome in done.outcomes]


def test_what_has_been_learned_drives_better_than_simple_and_nearly_as_well_as_lanes() -> None:
    who = (str(EXAMPLE / "district.npz"), "simple", "lanes")
    learned, simple, lanes = (sum(own.counted_rounds or 0 for own in driven("district", one, 16)) for one in who)
    assert learned > simple
    assert learned >= 0.3 * lanes


def test_under_the_shield_what_has_been_learned_keeps_the_rules() -> None:
    policy = str(EXAMPLE / "town.npz")
    bare, shielded = driven("town", policy, 3), driven("town", f"{policy}+shield", 3)
    assert sum(own.rounds for own in bare) > 0
    assert not any(own.verdict is None or own.verdict.clean for own in bare)
    assert all(own.verdict is not None and own.verdict.clean for own in shielded)


def _example(name: str) -> Any:
    """Return an example as a module."""
    spec = importlib.util.spec_from_file_location(name, EXAMPLE / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    example: Any = sys.modules.setdefault(name, importlib.util.module_from_spec(spec))
    spec.loader.exec_module(example)
    return example


@pytest.mark.parametrize("name", ["district", "town"])
def test_the_curve_comes_again(tmp_path: Path, name: str) -> None:
    _example("train").train(name, tmp_path, 2)
    with (EXAMPLE / f"{name}.csv").open() as kept, (tmp_path / f"{name}.csv").open() as made:
        before, again = ([float(row["mean_return"]) for row in csv.DictReader(file)] for file in (kept, made))
    assert again == pytest.approx(before[:2], abs=0.02)
    assert np.mean(before[-20:]) > 3.0 + np.mean(before[:20])


@pytest.mark.long
def test_what_has_been_taught_makes_counted_rounds_and_under_the_shield_as_many_as_its_teacher() -> None:
    taught = str(EXAMPLE / "junction.npz")
    config = load_config("junction")
    rounds = {
        who: sum(outcome.score.counted_rounds or 0 for outcome in run_batch(config, who, trials=14, seed=1000).outcomes)
        for who in ("lanes", "rules", taught, f"{taught}+shield")
    }
    assert rounds["lanes"] == 0
    assert rounds[taught] > 0
    assert rounds[f"{taught}+shield"] >= 0.9 * rounds["rules"]


def test_teaching_lessens_the_cross_entropy(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two short rounds: who is taught drives, and what it saw is learned from."""
    example = _example("clone")
    monkeypatch.setattr(example, "CONFIG", a_minute("junction"))
    learned, entropies = example.learn(1, 2, 2, 3)
    assert entropies[-1] < 0.5 * np.log(len(example.CHOICES))
    assert len(learned.layers) == 3
    assert learned.act(np.zeros(Layout(example.CARS).size)).tolist() in learned.choices.tolist()


def policy(*sizes: int, names: tuple[str, ...] = ("own.speed",), choices: Any = (), fill: float = 0.0) -> Policy:
    """Return a policy whose layers have so many rows, with all weights alike."""
    rows = sizes or (3, 2)
    widths = (len(names), *rows)
    layers = tuple((np.full((after, before), fill), np.arange(after, 0.0, -1.0)) for before, after in pairwise(widths))
    return Policy(names, 1, 2, layers, np.array(choices, dtype=np.float64).reshape(-1, 2))


def test_a_policy_has_any_number_of_layers_and_may_choose_among_actions(tmp_path: Path) -> None:
    seen, deep = np.array([0.25]), policy(4, 3, 2, fill=0.1)
    inner = seen
    for rows in (4, 3):
        inner = np.tanh(np.full(rows, 0.1 * inner.sum()) + np.arange(rows, 0.0, -1.0))
    assert deep.act(seen) == pytest.approx(np.tanh(0.1 * inner.sum() + np.array([2.0, 1.0])))
    choosing = policy(3, choices=[(0.0, 0.5), (1.0, 0.0), (0.5, -1.0)])
    choosing.save(tmp_path / "own.npz")
    again = load(tmp_path / "own.npz")
    assert again.act(seen).tolist() == choosing.act(seen).tolist() == [0.0, 0.5]


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"sizes": (3, 4)}, "weights1"), ({"fill": np.nan}, "weights0"), ({"choices": [(0.0, 1.0)]}, "weights1"),
        ({"choices": [(0.0, 2.0)], "sizes": (1,)}, "choices"),
    ],
)  # fmt: skip
def test_a_policy_whose_layers_do_not_fit_is_refused(wrong: dict[str, Any], named: str) -> None:
    with pytest.raises(InputError, match=named):
        policy(*wrong.pop("sizes", ()), **wrong)


def test_a_policy_without_layers_is_refused() -> None:
    with pytest.raises(InputError, match="weights0"):
        Policy(("own.speed",), 1, 1, ())


def test_a_policy_is_told_from_a_strategy_and_a_damaged_one_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "own.npz"
    own = policy()
    own.save(path)
    assert isinstance(registry.load(str(path)), Learned)
    assert load(path).frame_skip == 2
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match=r"own\.npz"):
        load(path)
    odd = policy(names=("own.colour",))
    with pytest.raises(InputError, match=r"own\.colour"):
        Learned(odd).start(next(iter(run_batch("demo", "simple", trials=1).outcomes)).instance.problem)
