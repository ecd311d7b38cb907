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

from dubins_traffic.agents.registry import names as agent_names
from dubins_traffic.cars.dynamics import names as car_model_names
from dubins_traffic.controllers.registry import names as controller_names
from dubins_traffic.problem.configuration import Configuration, load_config, shipped_names
from dubins_traffic.problem.kinds import COUNTER, FREE, KEEP_RULES, KINDS, REMOTE
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
                    "name": own.name,
                    "required": own.required,
                    "default": own.default,
                    "description": own.meaning,
                }
                for own in self.parameters
            ],
            "remarks": list(self.remarks),
        }


def agents() -> tuple[Entry, ...]:
    """Return the kinds of e-agents."""
    found: list[Entry] = []
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
        found.append(Entry(name, line, tuple(parameters), remarks))
    return tuple(found)


def rules() -> tuple[Parameter, ...]:
    """Return the parameters of the rules of the road, in the order of their definition."""
    meanings = _attribute_docs(RuleParameters)
    found: list[Parameter] = []
    for own in fields(RuleParameters):
        text = meanings.get(own.name, "")
        if own.name.startswith("assume_"):
            text = f"Whether the problem assumes {own.name.removeprefix('assume_').upper()} of the e-agents, 0 or 1."
        unit = _unit(own.name)
        meaning = text.rstrip(".") + (f", {unit}" if unit else "")
        found.append(Parameter(own.name, own.default, False, meaning))
    return tuple(found)


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
    found: list[Entry] = []
    for name, line in metric_names().items():
        told = (f"{own.name}: {own.meaning or own.heading}" for own in columns([name]))
        found.append(Entry(name, line, (), tuple(told)))
    return tuple(found)


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
    found: dict[str, str] = {}
    for own, below in pairwise(body):
        if (
            isinstance(own, ast.AnnAssign)
            and isinstance(own.target, ast.Name)
            and isinstance(below, ast.Expr)
        ):
            text = below.value.value if isinstance(below.value, ast.Constant) else ""
            found[own.target.id] = " ".join(str(text).split())
    return found


def _line(configuration: Configuration) -> str:
    """Return a configuration as one line of text."""
    own = configuration.settings
    goals = _bounds([len(own.goals)] * 2 if own.goals is not None else own.number_goals_bounds)
    seconds = _bounds([own.duration] * 2 if own.duration is not None else own.duration_bounds)
    kinds: dict[str, int] = {}
    for planned in configuration.agents:
        kinds[planned.agent.kind] = kinds.get(planned.agent.kind, 0) + 1
    cars = " and ".join(f"{count} {kind}" for kind, count in kinds.items()) or "no e-agents"
    judged = "judged by the rules of the road" if own.rules else "not judged by the rules"
    parts = (
        f"{own.number_trials} trials of {seconds} s",
        _roads(configuration),
        f"{goals} goals" + _apart(own.goal_segments_apart) + _reach(own.goal_round_share),
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
        return (
            f"random networks of {drawn.random.intersections} intersections and {drawn.random.segments} roads"
        )
    if drawn is not None and drawn.grid is not None:
        return f"grids of {drawn.grid.rows} by {drawn.grid.columns}"
    network = configuration.network
    return "a network" if network is None else f"a network of {len(network.intersections)} intersections"


def _bounds(bounds: list[Any]) -> str:
    low, high = bounds
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"
