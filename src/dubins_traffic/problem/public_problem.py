"""The problem as a document, for controllers in other processes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from dubins_traffic.cars.state import Pose
from dubins_traffic.errors import InputError
from dubins_traffic.problem.document import instance_from_document, instance_to_document
from dubins_traffic.problem.instance import EAgent, Instance, Problem
from dubins_traffic.problem.kinds import REMOTE

SECRET = ("starts", "duration", "seed", "trial", "end_on_collision", "simulator")
"""Fields of an instance that a controller is not given."""


def problem_to_document(problem: Problem) -> dict[str, Any]:
    """Return the document of `problem`: that of an instance, version 1, without the fields in `SECRET`.

    Of the disturbances it gives delay, noise and loss, if there are any. Of the e-agents it gives the names; their type
    is always given as `remote`.
    """
    cars = 1 + len(problem.e_agents)
    agents = tuple(EAgent(REMOTE, name, REMOTE) for name in problem.e_agents)
    instance = Instance(problem, (Pose(0.0, 0.0, 1.0, 0.0),) * cars, 1.0, agents, seed=0, trial=0)
    (position, heading), delay = problem.pose_noise, problem.command_delay
    known = {"position_noise": position, "heading_noise": heading, "command_delay": delay}
    known |= {"command_loss": problem.command_loss} if problem.command_loss else {}
    whole = instance_to_document(instance)
    document = {key: value for key, value in whole.items() if key not in (*SECRET, "disturbances")}
    return document | {"disturbances": known} if any(known.values()) else document


def problem_from_document(document: Mapping[str, Any], file: str | None = None) -> Problem:
    """Return the problem that `problem_to_document` described; of an instance of version 1, its problem.

    Raises
    ------
    InputError
        For the first thing wrong, with its field.
    """
    alone: dict[str, Any] = {key: value for key, value in document.items() if key not in SECRET}
    alone |= {"e-agents": [], "duration": 1.0}
    problem = instance_from_document(alone, file).problem
    entries = document.get("e-agents", [])
    try:
        return replace(problem, e_agents=tuple(str(entry["name"]) for entry in entries))
    except (TypeError, KeyError) as error:
        raise InputError(
            "not e-agents", file=file, field="e-agents", expected="a list of objects with type and name"
        ) from error
