"""A small suite of trials and one of games for tests."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.document import instance_to_document
from dubins_traffic.problem.draw import draw


def document(**changes: Any) -> dict[str, Any]:
    """Return the document of a suite of two controllers and two cells of two trials, with `changes`."""
    town = {
        "version": 1,
        "problem_domain": "dubins_traffic",
        "network": {"grid": {"rows": 2, "columns": 3, "length": 6}},
        "e-agents": [{"type": "lawful", "name": "car", "count": 1}],
        "duration": 2,
        "number_goals_bounds": [2, 2],
        "laser": False,
        "rules": True,
    }
    campaign = {
        "version": 0,
        "seed": 7,
        "trials": 2,
        "controllers": ["rules", "lanes"],
        "configurations": [{"name": "town", "document": town}],
        "factors": {"e_agents": [0, 1]},
    }
    return {"version": 0, "name": "small", "title": "Small", "campaign": campaign, **changes}


def games(**changes: Any) -> dict[str, Any]:
    """Return the document of a suite of two games, the first won from everywhere, with `changes`."""
    grid = {"version": 0, "length": 3, "transform": [0, 0, 0], "shape": [2, 2]}
    own = {"rnd": grid, "goals": [[0, 0], [1, 1]], "order_degree": 1}
    entries = [
        {**own, "name": "one", "cars": 1, "assume": "E1,E2,E3,E4,E5,E6", "positions": 140, "winning": 140},
        {**own, "name": "two", "cars": 2, "assume": "E6", "positions": 1988, "winning": 0},
    ]
    return {"version": 0, "name": "small-games", "title": "Small", "games": entries, **changes}


def cases(number: int = 3, **changes: Any) -> dict[str, Any]:
    """Return the document of a suite of cases, with `changes`."""
    town = document()["campaign"]["configurations"][0]["document"]
    instances = [draw(load_config(town), 3, trial) for trial in range(number)]
    entries = [{"name": f"case-{k}", "document": instance_to_document(one)} for k, one in enumerate(instances)]
    return {"version": 0, "name": "small-cases", "title": "Small", "cases": entries, **changes}


def written(path: Path, some: dict[str, Any]) -> Path:
    """Write a document and return its path."""
    path.write_text(json.dumps(some))
    return path
