"""Models of the campaign file: what it may say, and the defaults."""

from __future__ import annotations

from pathlib import PurePath
from typing import Annotated, Any, cast

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema, model_validator

from dubins_traffic.problem import limits
from dubins_traffic.problem.faults import Strict, fault
from dubins_traffic.problem.parts import Length
from dubins_traffic.roads.generate import MOST_INTERSECTIONS

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


Mix = Annotated[
    list[AgentKind],
    BeforeValidator(_kinds),
    Field(min_length=1, json_schema_extra=_kinds_schema),
]
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
    lane_width: Annotated[list[Length], Some] | None = Field(
        default=None, description="widths of a lane, 2w, m"
    )
    speed: Annotated[list[Speed], Some] | None = Field(
        default=None, description="largest speeds of the cars, m/s"
    )
    yaw_rate: Annotated[list[YawRate], Some] | None = Field(
        default=None, description="largest yaw rates, rad/s"
    )
    turning_radius: Annotated[list[Radius], Some] | None = Field(
        default=None, description="smallest turning radii, m"
    )
    sensing_radius: Annotated[list[Length], Some] | None = Field(
        default=None, description="distances within which other cars are seen, m"
    )
    rules: Annotated[list[RulesValue], Some] | None = Field(
        default=None, description="whether the rules are judged, or their parameters"
    )
    duration: Annotated[list[Seconds], Some] | None = Field(
        default=None, description="durations of a trial, s"
    )

    @model_validator(mode="after")
    def _one_network(self) -> Factors:
        if self.grid is not None and self.intersections is not None:
            raise fault("two kinds of road network", "either grid or intersections", "grid", self.grid)
        return self


class ConfigurationEntry(Strict):
    """A configuration under a name of its own."""

    name: str = Field(pattern=NAME, max_length=80, description="what it is called in tables")
    file: str | None = Field(
        default=None, min_length=1, description="a file, or the name of a shipped configuration"
    )
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
    controllers: Annotated[list[str], Some] = Field(
        description="built-in names, module:Class or path/to/file.py:Class"
    )
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
