"""E-agents that are slow: those to which E5 gives time enough drive, slower ones are refused by name."""

from __future__ import annotations

from typing import Any

import pytest

from dubins_traffic.errors import InputError
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.runs.single import run_trial
from tests.unit.test_law_company import Stands, breaches

CRAWL = 0.06
"""Faster than what lingers, m/s: nobody may overtake it."""


def drawn(trial: int, length: float, *agents: dict[str, Any], **more: Any) -> Instance:
    document = {
        "version": 1,
        "problem_domain": "dubins_traffic",
        "network": {"grid": {"rows": 3, "columns": 3, "length": length}},
        "e-agents": list(agents),
        "goals": [[0, 0], [2, 2]],
        "number_trials": 1,
        "duration": 400.0,
        "rules": True,
        **more,
    }
    return draw(load_config(document), 3, trial)


def slow(speed: float, count: int = 1, kind: str = "lawful") -> dict[str, Any]:
    return {"type": kind, "name": kind, "count": count, "parameters": {"speed": speed}}


@pytest.mark.parametrize("trial", range(3))
def test_among_crawlers_the_ego_makes_its_rounds_and_nobody_breaks_anything(trial: int) -> None:
    score = run_trial(drawn(trial, 4.0, slow(CRAWL, 3)), "rules").score
    assert breaches(score) == []
    assert score.verdict is not None
    assert score.verdict.clean
    assert score.rounds >= 1


@pytest.mark.parametrize("kind", ["lawful", "nemesis", "counter"])
def test_who_is_too_slow_for_e5_is_refused_by_name(kind: str) -> None:
    with pytest.raises(InputError, match="too slow to come to an intersection in time") as caught:
        run_trial(drawn(0, 4.0, slow(0.05, kind=kind)), Stands())
    assert caught.value.field == "e-agents[0].parameters.speed"


def test_where_e5_is_not_assumed_anybody_may_be_slow() -> None:
    trial = drawn(0, 4.0, slow(0.05), rules={"assume_e5": 0}, duration=5.0)
    assert str(run_trial(trial, Stands()).score.end) == "duration"


def test_a_nemesis_on_long_roads_is_not_so_slow_that_it_breaks_e5() -> None:
    """On roads of 40 m a car at 0.12 m/s takes 333 s, and E5 allows 289 s."""
    agent = {"type": "nemesis", "name": "nemesis", "start": [22.0, -0.3, 0.0]}
    ego = {"start": [20.5, -0.3, 0.0]}
    grid = {"grid": {"rows": 2, "columns": 2, "length": 40.0}}
    trial = drawn(0, 4.0, agent, network=grid, goals=[[0, 0], [1, 1]], ego=ego, duration=320.0)
    score = run_trial(trial, "rules").score
    assert breaches(score) == []
