"""A sample of `experiments.rules`, which shows the bars on 1,000 trials and more."""

import pytest
from experiments.rules import Drive, drive

SAMPLE = 12


@pytest.fixture(scope="module")
def lawful() -> list[Drive]:
    return [drive(number, "lawful", 120.0) for number in range(SAMPLE)]


def test_rules_is_clean_among_lawful_cars(lawful: list[Drive]) -> None:
    assert [one.number for one in lawful if one.own or one.collisions] == []


def test_lawful_cars_break_nothing(lawful: list[Drive]) -> None:
    assert [(one.number, one.others) for one in lawful if one.others] == []


def test_nobody_waits_long_and_the_rounds_are_made(lawful: list[Drive]) -> None:
    assert max(one.waited for one in lawful) < 60.0
    assert [one.number for one in lawful if one.rounds < 0.3 * one.free_rounds] == []


def test_rules_is_clean_with_a_nemesis() -> None:
    found = [drive(number, "nemesis", 120.0) for number in range(SAMPLE // 2)]
    assert [(one.number, one.own, one.others) for one in found if one.own or one.others] == []


def test_rules_is_never_at_fault_among_cars_that_break_rules() -> None:
    found = [drive(number, "breakers", 120.0) for number in range(SAMPLE // 2)]
    assert [one.number for one in found if one.at_fault] == []
    assert all(one.others for one in found)


@pytest.mark.parametrize(
    ("habit", "rule"), [("rolls", "3.stop"), ("left", "2.left"), ("blocks", "E4"), ("parks", "E6")]
)
def test_cars_with_one_bad_habit_break_its_rule_and_rules_is_clean(habit: str, rule: str) -> None:
    """Who tailgates meets slower cars too seldom here: see the tests of the law."""
    found = [drive(number, habit, 120.0) for number in (2, 5, 7, 9)]
    assert all(rule in one.others for one in found)
    assert [one.number for one in found if one.own or one.at_fault] == []


def test_rules_is_clean_with_bodies_and_bounds_of_other_kinds() -> None:
    rectangle = {"rectangle": {"length": 0.4, "width": 0.25}}
    cars = ({"body": rectangle}, {"bounds": {"turning_radius": 0.26}})
    found = [drive(number, "lawful", 60.0, car) for number in range(SAMPLE // 2) for car in cars]
    assert [one.number for one in found if one.own or one.others or one.collisions] == []
