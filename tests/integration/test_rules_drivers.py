"""A sample of `experiments.rules`, which shows the bars on 1,000 trials and more."""

import pytest
from experiments.rules import Drive, drive

from dubins_traffic.problem.document import instance_from_document
from dubins_traffic.runs.single import run_trial

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


@pytest.mark.parametrize("rate", [10, 30])
def test_rules_drives_off_beside_an_obstacle_that_it_touches_at_the_start(rate: int) -> None:
    """Starts are drawn clear of obstacles, but not by any distance."""
    instance = instance_from_document(
        {
            "version": 1,
            "goals": [[0, 0], [2, 1]],
            "rnd": {
                "version": 0, "length": 4.5, "transform": [0, 0, 0], "shape": [2, 3],
                "segments": [[0, 0, 1, 0], [1, 0, 1, 1], [1, 1, 2, 1]],
            },
            "intersection_radius": 1.0,
            "starts": {"ego": [4.2, 2.527000001, 0.0, -1.0]},
            "duration": 120.0,
            "e-agents": [],
            "rate": rate,
            "rules": True,
            "obstacles": [{"disc": {"x": 4.2, "y": 2.25, "radius": 0.1}}],
        },
        "touching.json",
    )  # fmt: skip
    verdict = run_trial(instance, "rules").score.verdict
    assert verdict is not None
    assert (verdict.verdict, verdict.rounds) == ("satisfied", 3)
