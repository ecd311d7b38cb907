"""What a campaign file may say, and how the values of its factors are put into configurations."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from pathlib import PurePath
from typing import Annotated, Any, TypeAlias, cast

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema, model_validator

from dubins_traffic.errors import InputError
from dubins_traffic.problem import limits
from dubins_traffic.problem.faults import Open, Strict, fault
from dubins_traffic.problem.parts import Length
from dubins_traffic.problem.settings import VERSION_0_KEYS, AgentEntry, Settings
from dubins_traffic.roads.generate import MOST_INTERSECTIONS, most_segments

NAME = r"^[^\s/\\][^/\\]*$"
MOST_CELLS = 100_000
"""Most combinations of a configuration and factors."""
MOST_TRIALS = 100_000_000
"""Most trials of a campaign, all controllers together."""

Side = Annotated[int, Field(ge=1, le=limits.INTERSECTIONS)]
Shape = Annotated[list[Side], Field(min_length=2, max_length=2)]
Speed = Annotated[float, Field(ge=limits.LEAST, le=limits.SPEED)]
YawRate = Annotated[float, Field(ge=limits.LEAST, le=limits.RATE)]
Radius = Annotated[float, Field(ge=0, le=limits.METRES)]
Seconds = Annotated[float, Field(gt=0, le=limits.SECONDS)]


class AgentKind(Strict):
    """A kind of e-agent with parameters of its own."""

    type: str = Field(description='what drives it: wander, lawful, nemesis, ... or "wander/wander"')
    parameters: dict[str, Any] = Field(default={}, description="parameters of its kind")


def _or_text(schema: dict[str, Any]) -> None:
    """Let a schema of objects allow a text as well."""
    model = dict(schema)
    schema.clear()
    schema["anyOf"] = [{"type": "string", "minLength": 1}, model]


def _kinds(value: object) -> object:
    """Read a kind, or a text for one, as a list of one."""
    items = cast("list[object]", value) if isinstance(value, list) else [value]
    return [{"type": item} if isinstance(item, str) else item for item in items]


def _kinds_schema(schema: dict[str, Any]) -> None:
    kind = {"anyOf": [{"type": "string", "minLength": 1}, schema["items"]]}
    schema.clear()
    schema["anyOf"] = [*kind["anyOf"], {"type": "array", "items": kind, "minItems": 1}]


def _rules(value: object) -> object:
    if isinstance(value, bool | dict):
        return value  # pyright: ignore[reportUnknownVariableType]
    raise fault("not rules", "true, false, or a table of parameters of the rules")


Mix = Annotated[list[AgentKind], BeforeValidator(_kinds), Field(min_length=1, json_schema_extra=_kinds_schema)]
RulesValue = Annotated[Any, AfterValidator(_rules), WithJsonSchema({"type": ["boolean", "object"]})]
Some = Field(min_length=1)


class Factors(Strict):
    """What varies, besides the configuration; every combination of the values is run."""

    e_agents: Annotated[list[Annotated[int, Field(ge=0, le=limits.CARS)]], Some] | None = Field(
        default=None, description="numbers of e-agents; the entries of the configuration are taken in turn"
    )
    e_agent_kinds: Annotated[list[Mix], Some] | None = Field(
        default=None,
        description="what drives the e-agents: a kind, {type, parameters}, or a list of these to take in turn",
    )
    grid: Annotated[list[Shape], Some] | None = Field(
        default=None, description="[rows, columns] of a grid that takes the place of the road network"
    )
    intersections: Annotated[list[Annotated[int, Field(ge=2, le=MOST_INTERSECTIONS)]], Some] | None = Field(
        default=None, description="sizes of a random network that takes the place of the road network"
    )
    lane_width: Annotated[list[Length], Some] | None = Field(default=None, description="widths of a lane, 2w, m")
    speed: Annotated[list[Speed], Some] | None = Field(default=None, description="largest speeds of the cars, m/s")
    yaw_rate: Annotated[list[YawRate], Some] | None = Field(default=None, description="largest yaw rates, rad/s")
    turning_radius: Annotated[list[Radius], Some] | None = Field(default=None, description="smallest turning radii, m")
    sensing_radius: Annotated[list[Length], Some] | None = Field(
        default=None, description="distances within which other cars are seen, m"
    )
    rules: Annotated[list[RulesValue], Some] | None = Field(
        default=None, description="whether the rules are judged, or their parameters"
    )
    duration: Annotated[list[Seconds], Some] | None = Field(default=None, description="durations of a trial, s")

    @model_validator(mode="after")
    def _one_network(self) -> Factors:
        if self.grid is not None and self.intersections is not None:
            raise fault("two kinds of road network", "either grid or intersections", "grid", self.grid)
        return self


class ConfigurationEntry(Strict):
    """A configuration under a name of its own."""

    name: str = Field(pattern=NAME, max_length=80, description="what it is called in tables")
    file: str | None = Field(default=None, min_length=1, description="a file, or the name of a shipped configuration")
    document: dict[str, Any] | None = Field(default=None, description="the configuration itself")

    @model_validator(mode="after")
    def _one(self) -> ConfigurationEntry:
        if (self.file is None) == (self.document is None):
            raise fault("not one configuration", "either file or document")
        return self


def _entry(value: object) -> object:
    """Read a text as the file of a configuration that is called as the file is."""
    if not isinstance(value, str):
        return value
    name = PurePath(value).name
    return {"name": name.removesuffix(".json") or name, "file": value}


Entry = Annotated[ConfigurationEntry, BeforeValidator(_entry), Field(json_schema_extra=_or_text)]


class CampaignModel(Strict):
    """A campaign: controllers on configurations under varied factors, each on the same instances."""

    version: Annotated[int, Field(ge=0, le=0)] = Field(description="0")
    name: str = Field(default="campaign", pattern=NAME, max_length=80, description="title of the report")
    seed: Annotated[int, Field(ge=0, lt=limits.SEEDS)] = Field(
        default=0, description="root seed, from which all instances follow"
    )
    trials: Annotated[int, Field(ge=1, le=MOST_TRIALS)] | None = Field(
        default=None,
        description="trials of each combination for each controller; left out: as each configuration says",
    )
    controllers: Annotated[list[str], Some] = Field(description="built-in names, module:Class or path/to/file.py:Class")
    configurations: Annotated[list[Entry], Some] = Field(
        description="files, names of shipped configurations, or {name, file} or {name, document}"
    )
    factors: Factors = Field(default=Factors(), description="what varies")
    fields: dict[str, Annotated[list[Any], Some]] = Field(
        default={},
        description="further factors: values of any field of the configuration, by its path, such as "
        '"disturbances.position_noise" or "e-agents[0].parameters.speed"',
    )
    metrics: list[Annotated[str, Field(min_length=1)]] = Field(
        default=[], description="further metrics: names, module:Class or path/to/file.py:Class"
    )
    deadline: Annotated[float, Field(gt=0, le=limits.SECONDS)] | None = Field(
        default=None,
        description="wall-clock seconds within which each act must answer; such ends do not repeat exactly",
    )
    chunk: Annotated[int, Field(ge=1, le=limits.TRIALS)] | None = Field(
        default=None, description="most trials in a unit of work; left out: by their length"
    )


Scalar: TypeAlias = bool | int | float | str
Document: TypeAlias = dict[str, Any]

_STEP = re.compile(r"([^.\[\]]+)|\[(\d+)\]")


def raised(document: Mapping[str, Any]) -> Document:
    """Return a version 0 configuration as one of version 1 that means the same; others as they are."""
    if document.get("version") != 0:
        return deepcopy(dict(document))
    known = {key: deepcopy(value) for key, value in document.items() if key in VERSION_0_KEYS}
    agents = [{"type": entry["type"], "name": entry["name"]} for entry in known.get("e-agents", [])]
    return {**known, "version": 1, "e-agents": agents, "ego": {"start": "origin"}}


def vary(document: Mapping[str, Any], factors: Mapping[str, Any], fields: Mapping[str, Any]) -> Document:
    """Return a configuration with one value of each factor put in.

    Parameters
    ----------
    document : Mapping
        A configuration; with no factor at all it is returned as it is.
    factors : Mapping
        Name of a factor of `Factors` to one of its values, as its model gives it.
    fields : Mapping
        Path of a field to its value.
    """
    if not factors and not fields:
        return deepcopy(dict(document))
    changed = raised(document)
    for name, change in _CHANGES.items():
        if name in factors:
            try:
                change(changed, factors[name])
            except InputError as error:
                raise error.within(field=f"factors.{name}") from None
    if "e_agents" in factors or "e_agent_kinds" in factors:
        _agents(changed, factors.get("e_agents"), factors.get("e_agent_kinds"))
    for path, value in fields.items():
        put(changed, path, value)
    return changed


def put(document: Document, path: str, value: Any) -> None:
    """Set the field of `document` at `path`, such as ``car.bounds.speed`` or ``e-agents[0].count``.

    Objects on the way are made where there are none.
    """
    steps: list[str | int] = [name or int(index) for name, index in _STEP.findall(path)]
    if not steps or _written(steps) != path or isinstance(steps[0], int):
        expected = "names joined by dots, with [k] for the k-th of a list"
        raise InputError("not a path of a field", field="fields", value=path, expected=expected)
    _check_known(path, steps)
    place: Any = document
    for step, after in zip(steps, [*steps[1:], None], strict=True):
        inner = _below(place, step, path)
        if after is None:
            place[step] = deepcopy(value)
            return
        if isinstance(after, str) and (inner is None or isinstance(inner, bool)):
            place[step] = inner = cast("Document", {})
        place = inner


def _below(place: Any, step: str | int, path: str) -> Any:
    """Return what stands at `step` of an object or a list; None if an object has no such key."""
    if isinstance(step, str) and isinstance(place, dict):
        return cast("Document", place).get(step)
    if isinstance(step, int) and isinstance(place, list) and step < len(cast("list[Any]", place)):
        return cast("list[Any]", place)[step]
    raise InputError("leads nowhere in this configuration", field=f"fields.{path}", value=step, expected="a field")


def _check_known(path: str, steps: Sequence[str | int]) -> None:
    """Refuse a name that a configuration would keep without knowing it: nothing would vary."""
    checked: list[tuple[str | int, type[Open]]] = [(steps[0], Settings)]
    if len(steps) > 2 and steps[0] == "e-agents":
        checked.append((steps[2], AgentEntry))
    for step, model in checked:
        known = [info.alias or name for name, info in model.model_fields.items()]
        if step not in known:
            expected = f"one of {', '.join(known)}"
            raise InputError("unknown key", field=f"fields.{path}", value=step, expected=expected)


def scalar(value: Any) -> Scalar:
    """Return the value of a factor as a table has it: numbers, switches and texts as they are, else in words."""
    if isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, Mapping):
        table = cast("Mapping[str, Any]", value)
        if set(table) == {"type", "parameters"}:
            given = ", ".join(f"{name}={json.dumps(item)}" for name, item in table["parameters"].items())
            return f"{table['type']}({given})" if given else str(table["type"])
        return json.dumps(table, sort_keys=True)
    items = cast("Sequence[Any]", value)
    if len(items) == 2 and all(isinstance(item, int) for item in items):
        return f"{items[0]}x{items[1]}"
    if items and all(isinstance(item, Mapping) and "type" in item for item in items):
        return "+".join(str(scalar(item)) for item in items)
    return json.dumps(value, sort_keys=True)


def levels(factors: Factors) -> dict[str, list[Any]]:
    """Return the factors that are given, each with its values."""
    given = factors.model_dump()
    return {name: given[name] for name in Factors.model_fields if given[name] is not None}


def _written(steps: Sequence[str | int]) -> str:
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in steps)[1:]


def _grid(document: Document, shape: Sequence[int]) -> None:
    network = _network_of(document)
    grid: Document = network.get("grid") or {}
    length = grid.get("length") or _length(document.get("rnd"))
    document.pop("rnd", None)
    shaped = {**grid, "rows": shape[0], "columns": shape[1]}
    document["network"] = {"grid": shaped if length is None else {**shaped, "length": length}}


def _intersections(document: Document, count: int) -> None:
    """Ask for a random network of `count` intersections, as dense as the one asked for, else half as can be."""
    wanted: Document = _network_of(document).get("random") or {}
    share = 0.5
    if wanted:
        n = wanted["intersections"]
        room = most_segments(n) - (n - 1)
        share = (wanted["segments"] - (n - 1)) / room if room else 0.0
    segments = count - 1 + round(share * (most_segments(count) - (count - 1)))
    document.pop("rnd", None)
    document["network"] = {"random": {**wanted, "intersections": count, "segments": segments}}


def _network_of(document: Document) -> Document:
    return document.get("network") or {}


def _length(rnd: Any) -> float | None:
    return cast("Document", rnd).get("length") if isinstance(rnd, dict) else None


def _lane_width(document: Document, width: float) -> None:
    put(document, "car.w", 0.5 * width)


def _agents(document: Document, count: int | None, kinds: Sequence[Any] | None) -> None:
    """Give `document` e-agents: `count` of them (None: as many as it has), of `kinds` (None: of its own) in turn."""
    entries: list[Document] = document.get("e-agents") or []
    if count is None:
        count = sum(1 if entry.get("count") is None else entry["count"] for entry in entries)
    pattern: Sequence[Document] = kinds if kinds is not None else entries
    if count and not pattern:
        raise InputError(
            "the configuration has no e-agents to take in turn",
            field="factors.e_agents",
            value=count,
            expected="e-agents in the configuration, or e_agent_kinds",
        )
    turns = [pattern[k % len(pattern)] for k in range(count)]
    document["e-agents"] = [
        {"type": entry["type"], "name": f"agent{k}", "parameters": deepcopy(entry.get("parameters", {}))}
        for k, entry in enumerate(turns)
    ]


def _at(path: str) -> Callable[[Document, Any], None]:
    return lambda document, value: put(document, path, value)


def _duration(document: Document, seconds: float) -> None:
    document.pop("duration_bounds", None)
    document["duration"] = seconds


_CHANGES: Mapping[str, Callable[[Document, Any], None]] = {
    "grid": _grid,
    "intersections": _intersections,
    "lane_width": _lane_width,
    "speed": _at("car.bounds.speed"),
    "yaw_rate": _at("car.bounds.yaw_rate"),
    "turning_radius": _at("car.bounds.turning_radius"),
    "sensing_radius": _at("sensing_radius"),
    "rules": _at("rules"),
    "duration": _duration,
}
"""What each factor does, in this order; the e-agents follow."""
