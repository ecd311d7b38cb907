"""The course that `check-controller` runs: short trials on unusual instances."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance

SECONDS = 5
WANDERERS = ({"type": "wander/wander", "name": "agent0"}, {"type": "wander/wander", "name": "agent1"})
GRID = {"length": 3, "transform": [0, 0, 0], "shape": [3, 4]}
TREE = {
    "length": 3,
    "transform": [0, 0, 0],
    "shape": [2, 4],
    "segments": [[0, 0, 1, 0], [1, 0, 2, 0], [2, 0, 3, 0], [1, 0, 1, 1], [2, 0, 2, 1]],
}
ROAD = {"length": 4, "transform": [0, 0, 0], "shape": [1, 2], "segments": [[0, 0, 1, 0]]}
TURNED = {"length": 3.5, "transform": [-4.2, 1.7, 0.6], "shape": [3, 3]}

_SCENARIOS: Mapping[str, Mapping[str, Any]] = {
    "two goals and two e-agents": {"rnd": GRID, "number_goals_bounds": [2, 2], "e-agents": WANDERERS},
    "one goal": {"rnd": GRID, "number_goals_bounds": [1, 1], "e-agents": WANDERERS},
    "four goals": {"rnd": GRID, "number_goals_bounds": [4, 4], "e-agents": WANDERERS},
    "no e-agents": {"rnd": GRID, "number_goals_bounds": [2, 2]},
    "dead ends": {"rnd": TREE, "number_goals_bounds": [3, 3], "e-agents": WANDERERS[:1]},
    "a single road": {"rnd": ROAD, "number_goals_bounds": [2, 2]},
    "a rotated and shifted network": {"rnd": TURNED, "number_goals_bounds": [2, 2], "e-agents": WANDERERS},
}


def scenarios() -> Mapping[str, Instance]:
    """Return the instances by name, always the same."""
    common: dict[str, Any] = {
        "version": 0,
        "problem_domain": "dubins_traffic",
        "number_trials": 1,
        "duration_bounds": [SECONDS, SECONDS],
        "e-agents": [],
    }
    made: dict[str, Instance] = {}
    for number, (name, scenario) in enumerate(_SCENARIOS.items()):
        document = {**common, **scenario, "rnd": {"version": 0, **scenario["rnd"]}}
        document["e-agents"] = list(document["e-agents"])
        made[name] = draw(load_config(document), 1, number)
    return made
