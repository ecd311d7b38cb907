"""An ego that stands or waits beyond a disc brings no car that keeps the law to a breach: an exit is free by room."""

from __future__ import annotations

import json
import math
from importlib.resources import files
from typing import Any

import pytest

from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.runs.single import run_trial
from tests.unit.test_law import W, car, turned
from tests.unit.test_law_company import Stands, breaches

LONG_BODY = {"body": {"rectangle": {"length": 0.6, "width": 0.28}}}


def beyond(gap: float, radius: float = 1.0) -> float:
    """Return how far along its lane a centre is that is `gap` (m) beyond the disc at the lane's beginning."""
    return math.sqrt((radius + gap) ** 2 - W * W)


def drawn(document: dict[str, Any], trial: int, **more: Any) -> Instance:
    """Return a trial of a configuration with more fields."""
    return draw(load_config({**document, **more}), 1, trial)


@pytest.mark.parametrize("trial", [4, 7])
def test_nobody_is_held_to_leave_a_bend_into_which_its_length_does_not_fit(trial: int) -> None:
    """Cars of 0.62 m; the ego stands 0.83 m beyond the bend at (0, 0)."""
    suburb = json.loads((files("dubins_traffic.problem") / "configurations/suburb.json").read_text())
    ego = {"start": [beyond(0.83, 1.3), -W, 0.0]}
    instance = drawn(suburb, trial, ego=ego, duration=80.0)
    assert breaches(run_trial(instance, Stands()).score) == []


@pytest.mark.parametrize("trial", [3, 9])
def test_nor_are_long_cars_on_a_grid(trial: int) -> None:
    grid = {
        "version": 1,
        "problem_domain": "dubins_traffic",
        "network": {"grid": {"rows": 3, "columns": 3, "length": 4.0}},
        "car": LONG_BODY,
        "e-agents": [{"type": "lawful", "name": "car", "count": 4}],
        "ego": {"start": [beyond(0.83), -W, 0.0]},
        "goals": [[0, 0], [2, 2]],
        "number_trials": 1,
        "duration": 80.0,
        "rules": True,
    }
    assert breaches(run_trial(drawn(grid, trial), Stands()).score) == []


def test_a_goal_may_be_taken_while_a_queue_from_the_ego_fills_its_exit() -> None:
    """The first to turn round in the dead end stops behind the ego, the second finds no room behind the first."""
    agents = [car("lawful", name, turned(x, W, math.pi)) for name, x in (("first", 3.2), ("second", 4.2))]
    road = {
        "version": 1,
        "problem_domain": "dubins_traffic",
        "rnd": {"version": 0, "length": 7.0, "shape": [1, 2], "transform": [0.0, 0.0, 0.4]},
        "e-agents": agents,
        "ego": {"start": turned(beyond(0.9), -W)},
        "goals": [[0, 0]],
        "number_trials": 1,
        "duration": 90.0,
        "rules": {"crossing_degree": 1},
    }
    assert breaches(run_trial(drawn(road, 0), Stands()).score) == []
