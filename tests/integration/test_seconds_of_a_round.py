"""The bound in seconds of docs/theory.md#seconds: no ego `rules` goes longer without a visit."""

from __future__ import annotations

from math import ceil
from typing import Any

import pytest

from dubins_traffic.engine.batch import run_batch
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.rules.parameters import RuleParameters

LENGTH, SPEED = 3.0, 0.7
LANES, ALONE = 6, 22.0
"""Lanes of a round of the two goals, and the seconds of one on empty roads."""
RULES = {"rest_time": 6.0, "journey_start_time": 4.0, "journey_lengths": 1.5}


def journeys(cars: int) -> int:
    """Return K: how many journeys of e-agents may make the ego wait once."""
    others = 2 * min(3, cars - 1) + 1
    entries = min(3, cars)
    found = cars + entries
    for depth in range(1, ceil(cars / 2) + 1):
        entries = others * (entries + 1)
        found += 3**depth * entries
    return found


def bound(cars: int) -> float:
    own = RuleParameters.from_mapping(RULES)
    journey = own.rest_time + own.journey_lengths * LENGTH / SPEED
    return ALONE + 2 * LANES * journeys(cars) * journey


def test_the_bound_is_that_of_the_page() -> None:
    assert [journeys(cars) for cars in (1, 2, 3)] == [8, 31, 1011]
    assert [round(bound(cars)) for cars in (1, 2)] == [1215, 4645]


@pytest.mark.parametrize(("cars", "trials", "seconds"), [(1, 20, 3800.0), (2, 4, 14200.0)])
def test_no_ego_is_without_a_visit_for_longer(cars: int, trials: int, seconds: float) -> None:
    assert bound(cars) <= seconds / 3.0
    document: dict[str, Any] = {
        "version": 1,
        "problem_domain": "dubins_traffic",
        "network": {"grid": {"rows": 2, "columns": 3, "length": LENGTH}},
        "e-agents": [{"type": "lawful", "name": "car", "count": cars}],
        "goals": [[0, 0], [2, 1]],
        "number_trials": trials,
        "duration": seconds,
        "rules": RULES,
    }
    found = run_batch(load_config(document), "rules", trials=trials, seed=1).sheet.trials
    for score in found:
        assert score.verdict is not None
        assert score.verdict.clean
        assert not score.verdict.assumption_broken
        assert max(goal.longest_gap_s for goal in score.goals) <= bound(cars)
