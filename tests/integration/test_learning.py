"""The page on learning, and the example that learns: what it promises, and that its curve comes again."""

from __future__ import annotations

import csv
import importlib.util
import sys
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

pytestmark = pytest.mark.path

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "learning"
PAGE = ROOT / "docs" / "learning.md"


def test_the_page_names_all_that_stands_in_an_observation() -> None:
    page = PAGE.read_text(encoding="utf-8")
    table = page[page.index("| part | holds |") : page.index("Metres without a bound")]
    for name in Layout(1, 0).names:
        word = name.split(".")[-1]
        assert (
            f"`{word}`" in table
            or word in ("speed", "yaw_rate", "left")
            or name.startswith(("own.", "cars[0]."))
        )


def driven(name: str, controller: str, trials: int) -> list[Score]:
    """Return the scores of a controller in trials that nobody has learned from."""
    done = run_batch(load_config(str(EXAMPLE / f"{name}.json")), controller, trials=trials, seed=1000)
    return [outcome.score for outcome in done.outcomes]


def test_what_has_been_learned_drives_better_than_simple_and_nearly_as_well_as_lanes() -> None:
    who = (str(EXAMPLE / "district.npz"), "simple", "lanes")
    learned, simple, lanes = (
        sum(own.counted_rounds or 0 for own in driven("district", one, 16)) for one in who
    )
    assert learned > simple
    assert learned >= 0.3 * lanes


def test_under_the_shield_what_has_been_learned_keeps_the_rules() -> None:
    policy = str(EXAMPLE / "town.npz")
    bare, shielded = driven("town", policy, 3), driven("town", f"{policy}+shield", 3)
    assert sum(own.rounds for own in bare) > 0
    assert not any(own.verdict is None or own.verdict.clean for own in bare)
    assert all(own.verdict is not None and own.verdict.clean for own in shielded)


@pytest.mark.parametrize("name", ["district", "town"])
def test_the_curve_comes_again(tmp_path: Path, name: str) -> None:
    spec = importlib.util.spec_from_file_location("train", EXAMPLE / "train.py")
    assert spec is not None
    assert spec.loader is not None
    example: Any = sys.modules.setdefault("train", importlib.util.module_from_spec(spec))
    spec.loader.exec_module(example)
    example.train(name, tmp_path, 2)
    with (EXAMPLE / f"{name}.csv").open() as kept, (tmp_path / f"{name}.csv").open() as made:
        before, again = ([float(row["mean_return"]) for row in csv.DictReader(file)] for file in (kept, made))
    assert again == pytest.approx(before[:2], abs=0.02)
    assert np.mean(before[-20:]) > 3.0 + np.mean(before[:20])


def test_a_policy_is_told_from_a_strategy_and_a_damaged_one_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "own.npz"
    own = Policy(("own.speed",), 1, 2, np.zeros((3, 1)), np.zeros(3), np.zeros((2, 3)), np.array([1.0, 0.0]))
    own.save(path)
    assert isinstance(registry.load(str(path)), Learned)
    assert load(path).frame_skip == 2
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match=r"own\.npz"):
        load(path)
    with pytest.raises(InputError, match="hidden"):
        Policy(("own.speed",), 1, 2, np.zeros((3, 2)), np.zeros(3), np.zeros((2, 3)), np.zeros(2))
    odd = Policy(("own.colour",), 1, 2, np.zeros((3, 1)), np.zeros(3), np.zeros((2, 3)), np.zeros(2))
    with pytest.raises(InputError, match=r"own\.colour"):
        Learned(odd).start(next(iter(run_batch("demo", "simple", trials=1).outcomes)).instance.problem)
