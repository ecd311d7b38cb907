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


def beyond_line(gap: float, aside: float, radius: float = 1.0) -> float:
    """Return how far along its lane a centre is `gap` (m) beyond the disc, `aside` (m) of the centre line."""
    return math.sqrt((radius + gap) ** 2 - aside**2)


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


TILTS = (0.0, 0.3, 0.6, 0.9, 1.2, 1.5)


@pytest.mark.parametrize("rate", [10.0, 30.0])
@pytest.mark.parametrize("gap", [0.26, 0.4, 0.6])
@pytest.mark.parametrize("toward", [True, False])
def test_cars_pass_one_that_stands_tilted_at_the_centre_line_beside_a_bend(
    rate: float, gap: float, toward: bool
) -> None:
    """36 places at each rate; at 10 Hz what it may reach in a tick lies in the middle of the lane out of the bend."""
    length, width, over = 0.4, 0.25, 0.04
    for tilt in TILTS:
        aside = 0.5 * (math.sin(tilt) * length + math.cos(tilt) * width) - over
        far = beyond_line(gap, aside)
        start = [far, aside, math.pi + tilt] if toward else [far, -aside, tilt]
        square = {
            "version": 1,
            "problem_domain": "dubins_traffic",
            "network": {"grid": {"rows": 2, "columns": 2, "length": 4.0}},
            "car": {"body": {"rectangle": {"length": length, "width": width}}},
            "e-agents": [{"type": "lawful", "name": "car", "count": 4}],
            "ego": {"start": start},
            "goals": [[0, 0], [1, 1]],
            "number_trials": 1,
            "duration": 40.0,
            "rate": rate,
            "rules": True,
        }
        assert breaches(run_trial(drawn(square, 0), Stands()).score) == [], tilt
