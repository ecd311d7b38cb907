"""Whose breaches count: those that are not excused by what others have broken before."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dubins_traffic.cars.state import EGO
from dubins_traffic.envs.blame import blame_tables, part_that_counts
from dubins_traffic.envs.terms import PARTS
from dubins_traffic.errors import InputError
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Problem
from dubins_traffic.rules.breach_log import RULES
from dubins_traffic.rules.referee import Breach, order
from tests.blame_reference import Blame


def breach(rule: str, car: int, tick: int) -> Breach:
    return Breach(rule, car, tick, tick, 0.0, 0.0, -1, -1)


def counted(
    breaches: Sequence[Sequence[Breach]], excuses: bool | str | float = True, **rules: Any
) -> tuple[list[tuple[str, int]], int | None]:
    """Return what counts, part and car, of breaches that come in some calls, and who broke first."""
    tables = blame_tables([problem_of(rules)], 4, excuses)
    found: list[tuple[str, int]] = []
    for own in breaches:
        for one in sorted(own, key=lambda one: (one.tick, one.car == EGO, *order(one))):
            part = part_that_counts(0, one.car, RULES.index(one.rule), one.tick, tables)
            found += [(PARTS[part], one.car)] if part >= 0 else []
    first = int(tables.trial[0].first)
    return found, None if first < 0 else first


def problem_of(rules: dict[str, Any]) -> Problem:
    document = {
        "version": 1, "problem_domain": "dubins_traffic", "network": {"grid": {"rows": 2, "columns": 2}},
        "e-agents": [{"type": "lawful", "name": f"a{k}"} for k in range(3)], "number_trials": 1, "duration": 5,
        "rules": rules or True,
    }  # fmt: skip
    return draw(load_config(document), 1, 0).problem


def test_the_ego_is_charged_while_the_others_keep_their_part() -> None:
    assert counted([[breach("2.left", 0, 5)], [breach("3.stop", 0, 9)]]) == (
        [("2.left", 0), ("3.stop", 0)],
        0,
    )


def test_what_the_ego_breaks_after_others_is_excused_and_in_the_same_frame_they_move_first() -> None:
    assert counted([[breach("3.stop", 2, 5)], [breach("2.left", 0, 6)]]) == ([("E1", 2)], 2)
    assert counted([[breach("1.collision", 0, 5), breach("E2", 1, 5)]]) == ([("E2", 1)], 1)


def test_what_others_break_after_the_ego_is_excused_but_not_in_the_same_frame() -> None:
    assert counted([[breach("1.road", 0, 5)], [breach("E4", 1, 6)]]) == ([("1.road", 0)], 0)


def test_each_e_agent_answers_for_itself() -> None:
    assert counted([[breach("E4", 1, 5)], [breach("E2", 3, 9)], [breach("E5", 1, 9)]])[0] == [
        ("E4", 1), ("E2", 3), ("E5", 1),
    ]  # fmt: skip


def test_without_excuses_each_side_answers_for_all_that_it_breaks() -> None:
    both = [[breach("1.road", 0, 5)], [breach("E4", 1, 6)], [breach("2.left", 0, 9)]]
    assert counted(both, excuses=False) == ([("1.road", 0), ("E4", 1), ("2.left", 0)], 0)
    assert counted(both[1:], excuses=False) == ([("E4", 1), ("2.left", 0)], 1)


def test_in_a_window_only_what_was_broken_shortly_before_excuses() -> None:
    """At 30 Hz the second of the window has 30 ticks."""
    late = [[breach("E4", 1, 5)], [breach("2.left", 0, 35)], [breach("3.stop", 0, 36)]]
    assert counted(late, excuses="window")[0] == [("E4", 1), ("3.stop", 0)]
    assert counted(late)[0] == [("E4", 1)]
    others = [[breach("1.road", 0, 5), breach("E4", 1, 5)], [breach("E4", 2, 6), breach("1.road", 0, 37)]]
    assert counted(others, excuses="window")[0] == [("E4", 1), ("E4", 2), ("1.road", 0)]
    assert counted([[breach("1.road", 0, 5)], [breach("E4", 2, 51)]], excuses=1.5)[0] == [
        ("1.road", 0), ("E4", 2),
    ]  # fmt: skip


@pytest.mark.parametrize("wrong", ["soon", -1.0, float("nan")])
def test_other_excuses_are_refused(wrong: Any) -> None:
    with pytest.raises(InputError, match="excuses"):
        counted([], excuses=wrong)


def test_what_is_not_assumed_and_what_is_allowed_cost_nothing() -> None:
    assert counted([[breach("E5", 1, 5)], [breach("2.left", 0, 9)]], assume_e5=0) == ([("2.left", 0)], 0)
    allowed = [[breach("3.stop", 1, 5)], [breach("3.stop", 2, 9)], [breach("2.left", 1, 50)]]
    assert counted(allowed, exceptions=1) == ([("E1", 1)], 1)


OFTEN = ("1.road", "2.left", "2.turn", "3.stop", "3.order", "E2", "E3.enter", "E4", "E5", "E6")


@settings(max_examples=200, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 3), st.sampled_from(OFTEN), st.integers(0, 40)), max_size=40),
    st.sampled_from([True, False, "window", 0.3]),
    st.integers(0, 4),
)
def test_the_kernel_blames_as_the_reference_does(
    drawn: list[tuple[int, str, int]], excuses: bool | str | float, allowed: int
) -> None:
    kept = [
        breach("1.road" if car == 0 and rule.startswith("E") else rule, car, tick)
        for car, rule, tick in sorted(drawn, key=lambda one: one[2])
    ]
    by_frame = [[one for one in kept if one.tick == tick] for tick in range(41)]
    rules: dict[str, Any] = {"exceptions": allowed, "exception_time": 0.5, "assume_e5": 0}
    slow = Blame(problem_of(rules), excuses=excuses)
    found = [(part, one.car) for own in by_frame for one, part in slow.of(own)]
    assert counted(by_frame, excuses, **rules) == (found, slow.first)
