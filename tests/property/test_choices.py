"""E-agents of the kind `chosen`: a table without choices is the law, and with any choices they keep E1 to E3."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dubins_traffic.agents.choices import (
    BOUNDS,
    CHOICE,
    cut,
    drawn,
    empty,
    from_rows,
    mutated,
    reductions,
    table_of,
    to_rows,
    with_choices,
)
from dubins_traffic.cars.state import Pose
from dubins_traffic.engine.batch import outcomes
from dubins_traffic.errors import InputError
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.problem.kinds import parameters_of
from dubins_traffic.record.reader import read
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.score import score
from tests.property.test_batch import SEED, configuration, plain

LEGS = 12
CARS = 4


def trials(count: int, share: float, seconds: int = 60) -> Iterator[Instance]:
    """Yield instances in which random tables drive all e-agents."""
    own = [{"type": "chosen", "name": "a", "count": CARS}]
    networks: tuple[dict[str, Any], ...] = (
        {"grid": {"rows": 3, "columns": 3, "length": 4.0}},
        {"random": {"intersections": 8, "segments": 10}},
        {"grid": {"rows": 2, "columns": 3, "length": 3.0}},
    )
    drawn_from = [
        configuration(**{"network": network, "e-agents": own, "duration_bounds": [seconds, seconds]})
        for network in networks
    ]
    for trial in range(count):
        dice = np.random.default_rng(trial)
        instance = draw(drawn_from[trial % len(networks)], SEED, trial)
        yield with_choices(instance, {n: drawn(dice, LEGS, share) for n in range(1, 1 + CARS)})


def test_a_table_in_which_nothing_is_chosen_is_the_law(tmp_path: Path) -> None:
    drawn_from = configuration(**{"e-agents": [{"type": "lawful", "name": "a", "count": 3}]})
    lawful = draw(drawn_from, SEED, 0)
    nothing = with_choices(lawful, {n: empty(5) for n in (1, 2, 3)})
    assert [agent.kind for agent in nothing.e_agents] == ["chosen"] * 3
    assert nothing.e_agents[0].parameters["choices"] == []
    for name, instance in (("lawful", lawful), ("chosen", nothing)):
        run_trial(instance, "rules", record=tmp_path / f"{name}.mcap")
    one, other = (read(tmp_path / f"{name}.mcap").frames for name in ("lawful", "chosen"))
    assert all((getattr(one, name) == getattr(other, name)).all() for name in ("x", "y", "c", "s", "bits"))


def test_alone_in_a_batch_and_from_its_record_it_does_the_same(tmp_path: Path) -> None:
    own = list(trials(6, 0.6, seconds=12))
    for outcome in outcomes(own, "rules"):
        record = tmp_path / f"{outcome.instance.trial}.mcap"
        alone = run_trial(own[outcome.instance.trial], "rules", record=record)
        assert plain(outcome.score) == plain(alone.score) == plain(score(read(record)))
        assert read(record).instance.e_agents == outcome.instance.e_agents


def test_whatever_is_chosen_e1_to_e3_are_kept() -> None:
    found: Counter[str] = Counter()
    for outcome in outcomes(trials(400, 0.4), "rules"):
        verdict = outcome.score.verdict
        assert verdict is not None
        found.update(own.rule for own in verdict.violations if own.car != "ego")
    assert found.keys() <= {"E4"}
    assert found["E4"] <= 4


def test_tables_and_rows_say_the_same() -> None:
    dice = np.random.default_rng(1)
    for _ in range(50):
        table = drawn(dice, LEGS, 0.3)
        again = from_rows(to_rows(table))
        assert np.array_equal(again, table[: len(again)], equal_nan=True)
        assert not np.isfinite(table[len(again) :]).any()
        chosen = table[np.isfinite(table)]
        low, high = BOUNDS.T
        assert ((table >= low) & (table <= high) | np.isnan(table)).all()
        moved = mutated(dice, table)
        assert (~((moved == table) | (np.isnan(moved) & np.isnan(table)))).sum() <= 1
        less = list(reductions(table))
        assert all(np.isfinite(own).sum() < len(chosen) for own in less)
        assert sum(int(np.isfinite(own).sum() == len(chosen) - 1) for own in less) >= len(chosen)


def test_what_is_chosen_is_cut_to_what_the_rules_allow() -> None:
    problem = next(trials(1, 0.0)).problem
    table = empty(1)
    table[0] = (2.0, 0.0, 1e6, 0.5, 1e6, 1e6, 5.0)
    own = cut(table, 0.5, problem)[0]
    assert own[CHOICE.SPEED] == pytest.approx(problem.car.bounds.speed / 4.0)
    assert own[CHOICE.HOLD] == pytest.approx(8.0)
    assert own[CHOICE.PAUSE] == pytest.approx(0.8 * 60.0 - 20.0)
    assert 0.0 < own[CHOICE.DWELL] <= 1.0
    assert own[CHOICE.GAP] == pytest.approx(0.8)
    assert np.isnan(cut(empty(2), 0.5, problem)).all()


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ({"at": 0, "exit": 7}, "choices.*exit"),
        ({"at": 0, "holdd": 1.0}, "holdd"),
        ({"exit": 1}, "at: missing"),
    ],
)
def test_a_row_that_says_nothing_sensible_is_refused(row: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        configuration(**{"e-agents": [{"type": "chosen", "name": "a", "parameters": {"choices": [row]}}]})


def test_rows_come_in_order() -> None:
    with pytest.raises(InputError, match="rising order"):
        parameters_of("chosen", {"choices": [{"at": 1}, {"at": 0}]})


def test_a_nudged_car_that_is_in_time_and_exact_does_what_its_kind_does(tmp_path: Path) -> None:
    own = {"type": "lawful", "name": "a", "count": 3, "parameters": {"goes": "places"}}
    exact = {"kind": "lawful", "parameters": {"goes": "places"}, "delay": 0, "speed_noise": 0.0}
    frames: list[Any] = []
    nudged = [{**own, "type": "nudged", "parameters": {**exact, "delay": ticks}} for ticks in (0, 2)]
    for k, entry in enumerate((own, *nudged)):
        instance = draw(configuration(**{"e-agents": [entry]}), SEED, 0)
        run_trial(instance, "rules", record=tmp_path / f"{k}.mcap")
        frames.append(read(tmp_path / f"{k}.mcap").frames)
    lawful, same, late = ([getattr(one, name) for name in ("x", "y", "c", "s")] for one in frames)
    assert np.array_equal(lawful, same)
    assert not np.array_equal(lawful, late)


def test_a_car_starts_where_it_is_put_and_keeps_its_table() -> None:
    instance = next(trials(1, 0.0))
    pose = Pose(0.5, -0.3, 1.0, 0.0)
    moved = with_choices(instance, {}, {1: pose})
    assert moved.starts[1] == pose
    assert np.array_equal(table_of(with_choices(instance, {1: empty(3)}).e_agents[0]), empty(0))
