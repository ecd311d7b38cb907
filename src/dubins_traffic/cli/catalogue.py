"""The catalogue of all that can be chosen (e-agents, rules, controllers, ...), with parameters, read from the code."""

from __future__ import annotations

import ast
import inspect
import json
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any, Final

from pydantic_core import PydanticUndefined

from dubins_traffic.cars.dynamics import names as car_model_names
from dubins_traffic.controllers.registry import names as controller_names
from dubins_traffic.problem.configuration import Configuration, load_config, shipped_names
from dubins_traffic.problem.kinds import COUNTER, FREE, KEEP_RULES, KINDS, REMOTE
from dubins_traffic.problem.kinds import names as agent_names
from dubins_traffic.roads.formats.registry import names as format_names
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.scoring.registry import columns
from dubins_traffic.scoring.registry import names as metric_names
from dubins_traffic.simulators.registry import names as simulator_names

KEEP_E1: Final = KEEP_RULES | {COUNTER, FREE}
"""Kinds of e-agents that keep E1 unless they are told otherwise."""
BREAKS_E1: Final = "can't keep E1: a problem that assumes E1 is not for it"
UNKNOWN_E1: Final = "keeps E1 if its program does"
UNITS: Final = {
    "_time": "s",
    "_speed": "m/s",
    "_rounds": "rounds",
    "_lengths": "lengths",
    "_degree": "roads",
    "tickets": "tickets",
    "exceptions": "breaches",
    "edition": "",
    "_share": "share",
}
"""The unit of a parameter of the rules, by the end of its name; all others are in metres, or switches."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter: name, default (None if it is required or null), whether it is required, unit and meaning."""

    name: str
    default: Any
    required: bool
    meaning: str

    @property
    def shown(self) -> str:
        """The default as JSON."""
        return "required" if self.required else json.dumps(self.default)


@dataclass(frozen=True, slots=True)
class Entry:
    """Something that can be chosen: its name, a line of description, its parameters, and remarks."""

    name: str
    line: str
    parameters: tuple[Parameter, ...] = ()
    remarks: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Return it as a document."""
        return {
            "name": self.name,
            "description": self.line,
            "parameters": [
                {
                    "name": parameter.name,
                    "required": parameter.required,
                    "default": parameter.default,
                    "description": parameter.meaning,
                }
                for parameter in self.parameters
            ],
            "remarks": list(self.remarks),
        }


def agents() -> tuple[Entry, ...]:
    """Return the kinds of e-agents."""
    entries: list[Entry] = []
    for name, line in agent_names().items():
        parameters = [
            Parameter(
                key,
                None if info.default is PydanticUndefined else info.default,
                info.default is PydanticUndefined,
                info.description or "",
            )
            for key, info in KINDS[name].model_fields.items()
        ]
        remarks = () if name in KEEP_E1 else ((UNKNOWN_E1,) if name == REMOTE else (BREAKS_E1,))
        entries.append(Entry(name, line, tuple(parameters), remarks))
    return tuple(entries)


def rules() -> tuple[Parameter, ...]:
    """Return the parameters of the rules of the road, in the order of their definition."""
    meanings = _attribute_docs(RuleParameters)
    parameters: list[Parameter] = []
    for field in fields(RuleParameters):
        text = meanings.get(field.name, "")
        if field.name.startswith("assume_"):
            text = f"Whether the problem assumes {field.name.removeprefix('assume_').upper()} of the e-agents, 0 or 1."
        unit = _unit(field.name)
        meaning = text.rstrip(".") + (f", {unit}" if unit else "")
        parameters.append(Parameter(field.name, field.default, False, meaning))
    return tuple(parameters)


def configurations() -> tuple[Entry, ...]:
    """Return the shipped configurations."""
    return tuple(Entry(name, _line(load_config(name))) for name in shipped_names())


def controllers() -> tuple[Entry, ...]:
    """Return the controllers that come with the package."""
    return tuple(Entry(name, line) for name, line in controller_names().items())


def simulators() -> tuple[Entry, ...]:
    """Return the simulators."""
    return tuple(Entry(name, line) for name, line in simulator_names().items())


def metrics() -> tuple[Entry, ...]:
    """Return the optional metrics of this and other packages, with the columns that each adds."""
    entries: list[Entry] = []
    for name, line in metric_names().items():
        told = (f"{column.name}: {column.meaning or column.heading}" for column in columns([name]))
        entries.append(Entry(name, line, (), tuple(told)))
    return tuple(entries)


def car_models() -> tuple[Entry, ...]:
    """Return the car models of this and other packages."""
    return tuple(Entry(name, line) for name, line in car_model_names().items())


def map_formats() -> tuple[Entry, ...]:
    """Return the map formats of this and other packages."""
    return tuple(Entry(name, line) for name, line in format_names().items())


def _unit(name: str) -> str:
    if name.startswith("assume_"):
        return ""
    return next((unit for ending, unit in UNITS.items() if name.endswith(ending)), "m")


def _attribute_docs(kind: type[Any]) -> Mapping[str, str]:
    """Return the docstrings of the attributes of a class, by name."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(kind))).body[0]
    body = tree.body if isinstance(tree, ast.ClassDef) else []
    docs: dict[str, str] = {}
    for statement, below in pairwise(body):
        if (
            isinstance(statement, ast.AnnAssign)
            and isinstance(statement.target, ast.Name)
            and isinstance(below, ast.Expr)
        ):
            text = below.value.value if isinstance(below.value, ast.Constant) else ""
            docs[statement.target.id] = " ".join(str(text).split())
    return docs


def _line(configuration: Configuration) -> str:
    """Return a configuration as one line of text."""
    settings = configuration.settings
    goals = _bounds([len(settings.goals)] * 2 if settings.goals is not None else settings.number_goals_bounds)
    seconds = _bounds([settings.duration] * 2 if settings.duration is not None else settings.duration_bounds)
    kinds: dict[str, int] = {}
    for planned in configuration.agents:
        kinds[planned.agent.kind] = kinds.get(planned.agent.kind, 0) + 1
    cars = " and ".join(f"{count} {kind}" for kind, count in kinds.items()) or "no e-agents"
    judged = "judged by the rules of the road" if settings.rules else "not judged by the rules"
    parts = (
        f"{settings.number_trials} trials of {seconds} s",
        _roads(configuration),
        f"{goals} goals" + _apart(settings.goal_segments_apart) + _reach(settings.goal_round_share),
        cars,
        judged,
    )
    return ", ".join(parts)


def _apart(segments: int) -> str:
    return f" at least {segments} segments apart" if segments > 1 else ""


def _reach(share: float | None) -> str:
    return "" if share is None else f" within {share:g} of a trial"


def _roads(configuration: Configuration) -> str:
    drawn = configuration.settings.network
    if drawn is not None and drawn.random is not None:
        return f"random networks of {drawn.random.intersections} intersections and {drawn.random.segments} roads"
    if drawn is not None and drawn.grid is not None:
        return f"grids of {drawn.grid.rows} by {drawn.grid.columns}"
    network = configuration.network
    return "a network" if network is None else f"a network of {len(network.intersections)} intersections"


def _bounds(bounds: list[Any]) -> str:
    low, high = bounds
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"
