"""Searches find planted faults soon, without being told which; `python -m experiments.falsify` asks for all twelve."""

import math
import os

import pytest

import dubins_traffic as dt
from tests.cases_again import judged_afresh, still_broken
from tests.mutant_searches import first, first_broken, first_found
from tests.mutants import MUTANTS

FULL = os.environ.get("DUBINS_TRAFFIC_MUTANTS") == "full"
"""Whether cases of all mutants are judged afresh and shrunk: minutes."""
SELDOM = "left_long", 3
"""A mutant, and in how many of 2,048 trials drawn with seed 0 it breaks a rule."""
BROKEN = [
    ("lanes", 100, {"2.left", "2.return", "3.stop", "3.order", "3.clear"}),
    ("simple", 100, {"1.collision", "1.road", "2.left", "2.return", "3.stop", "3.clear"}),
    ("simple", 101, {"3.order"}),
]
"""The rules that two drivers break, and seeds of searches for them; `simple` seldom breaks 3.order: asked for alone."""
SECONDS = 60.0
"""Of a processor, on however slow and busy a machine."""


def test_a_search_finds_a_planted_fault_in_a_fifth_of_the_trials_that_chance_needs() -> None:
    name, broken = SELDOM
    hits = sorted(first(name, "evolution", seed, 400) or 800 for seed in (0, 1, 2))
    assert hits[1] <= math.log(2.0) * 2048 / broken / 5


@pytest.mark.parametrize(("driver", "seed", "rules"), BROKEN)
def test_each_rule_that_a_driver_breaks_is_found_in_seconds(driver: str, seed: int, rules: set[str]) -> None:
    found = first_broken(driver, rules, seed, 2000)
    assert found.keys() == rules
    assert max(seconds for _, seconds in found.values()) < SECONDS


@pytest.mark.parametrize("name", MUTANTS if FULL else ["left_long"])
def test_what_is_found_of_a_mutant_stands_and_in_full_is_shrunk_as_far_as_it_goes(name: str) -> None:
    driver = MUTANTS[name].kind
    found = first_found(name, "evolution", 100, 20_000)
    assert found is not None
    for case in found[1]:
        judged_afresh(case, driver)
    if FULL:
        assert still_broken(dt.shrink(found[1][0], driver), driver) == []
