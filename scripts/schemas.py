"""The JSON Schemas of all documents: made from the models, shipped beside them. ``make schemas`` writes all anew.

JSON Schema says less than the readers check: relations between values (a network that is planar, bounds in order) and
numbers such as 3.0 where an integer is asked. Files of campaigns and competitions are TOML; their schemas describe what
they say.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field

import dubins_traffic
from dubins_traffic.campaign.settings import CampaignModel
from dubins_traffic.competition.competition import CompetitionModel
from dubins_traffic.problem.faults import Open, Strict
from dubins_traffic.problem.kinds import KINDS, NAMES_2016, PROGRAM
from dubins_traffic.problem.parts import LatticePoint, Length
from dubins_traffic.problem.settings import InstanceModel, InstanceModel0, Settings, Settings0
from dubins_traffic.problem.trial_data import TrialData
from dubins_traffic.suites.results import ResultModel
from dubins_traffic.suites.suite import SuiteModel

MAKE = "make schemas"
"""The command that writes all of them."""
DIALECT = "https://json-schema.org/draft/2020-12/schema"
ID = "urn:dubins-traffic:"
Transform = Annotated[list[float], Field(min_length=3, max_length=3)]
Segment = Annotated[list[float], Field(min_length=4)]


class RoadNetworkModel(Open):
    """Road network description (RND), version 0 or 2. Unknown keys are kept."""

    version: Literal[0, 2] = Field(description="0, or 2 where segments bend or end off the integer lattice")
    length: Length = Field(description="metres of a lattice unit")
    transform: Transform = Field(default=[0, 0, 0], description="rigid motion [x, y, theta], m and rad")
    shape: LatticePoint | None = Field(
        default=None, description="[rows, columns]; without segments: the complete grid of that shape"
    )
    segments: Annotated[list[Segment], Field(min_length=1)] | None = Field(
        default=None,
        description="segments [x0, y0, x1, y1] between points of the integer lattice; in version 2 between any points, "
        "and followed by x, y, radius for each corner",
    )


def schemas() -> dict[tuple[str, str], dict[str, Any]]:
    """Return all schemas, by the room of the package that ships them and their name."""
    return {
        **{("problem", name): build() for name, build in _DOCUMENTS.items()},
        ("campaign", "campaign"): _with_configurations(CampaignModel, "campaign"),
        ("competition", "competition"): _with_configurations(CompetitionModel, "competition"),
        ("suites", "suite"): _with_configurations(SuiteModel, "suite"),
        ("suites", "suite-result"): _complete(ResultModel.model_json_schema(), "suite-result", "Results of a suite"),
    }


def text(schema: dict[str, Any]) -> str:
    """Return a schema as text."""
    return json.dumps(schema, indent=2, sort_keys=True) + "\n"


def place(room: str, name: str) -> Path:
    """Return where a schema is shipped."""
    return Path(dubins_traffic.__file__).parent / room / "schemas" / f"{name}.json"


def shipped(name: str, room: str = "problem") -> dict[str, Any]:
    """Return the schema called `name` that is shipped with a room of the package."""
    return json.loads(place(room, name).read_text(encoding="utf-8"))


def _with_configurations(model: type[BaseModel], name: str) -> dict[str, Any]:
    """Return the schema called `name` of a file that lists configurations; they refer to the schema of configurations.

    `model` is the file's; its configurations are of a model called ``ConfigurationEntry``.
    """
    schema = model.model_json_schema()
    document = schema["$defs"]["ConfigurationEntry"]["properties"]["document"]
    document["anyOf"][0] = {"$ref": ID + "configuration"}
    schema["properties"]["version"] = {"const": 0, "description": "0"}
    return _complete(schema, name, name.capitalize())


_ROADS_ONCE = {
    "oneOf": [
        {"required": ["rnd"], "not": {"required": ["network"]}},
        {"required": ["network"], "not": {"required": ["rnd"]}},
    ]
}


def _road_network() -> dict[str, Any]:
    schema = _of(RoadNetworkModel)
    for name in ("shape", "segments"):
        variants = schema["properties"][name].pop("anyOf")
        schema["properties"][name].update(variants[0])
        del schema["properties"][name]["default"]
    schema["anyOf"] = [{"required": ["shape"]}, {"required": ["segments"]}]
    plain = {"type": "array", "items": {"type": "integer"}, "maxItems": 4}
    schema["if"] = {"properties": {"version": {"const": 0}}}
    schema["then"] = {"properties": {"segments": {"items": plain}}}
    return schema


def _of(model: type[Strict]) -> dict[str, Any]:
    schema = model.model_json_schema(by_alias=True)
    rnd = schema["properties"].get("rnd")
    if rnd is not None:
        reference = {"$ref": "#/$defs/RoadNetwork"}
        instance = model in (InstanceModel0, InstanceModel)
        rnd.update(reference if instance else {"anyOf": [{"type": "string", "minLength": 1}, reference]})
        rnd.pop("default", None)
    schema["title"] = model.__name__.removesuffix("Model")
    return schema


def _versions(
    name: str, title: str, first: type[Strict], second: type[Strict], demands: list[dict[str, Any]]
) -> dict[str, Any]:
    """Return the schema of a document that is of version 0 or of version 1."""
    definitions: dict[str, Any] = {"RoadNetwork": _road_network()}
    for number, model in enumerate((first, second)):
        schema = _of(model)
        definitions.update(schema.pop("$defs", {}))
        schema["properties"]["version"] = {"const": number, "description": str(number)}
        if number and demands:
            schema["allOf"] = demands
        definitions[f"Version{number}"] = schema
    if "AgentEntry" in definitions:
        _describe_parameters(definitions)
    choice = {"if": {"properties": {"version": {"const": 0}}}, "then": {"$ref": "#/$defs/Version0"}}
    body = {**choice, "else": {"$ref": "#/$defs/Version1"}, "type": "object", "required": ["version"]}
    return _complete({**body, "$defs": definitions}, name, title)


def _describe_parameters(definitions: dict[str, Any]) -> None:
    """Tie the parameters of an e-agent to its type."""
    rules: list[dict[str, Any]] = []
    for kind, model in KINDS.items():
        schema = _of(model)
        definitions.update(schema.pop("$defs", {}))
        definitions[f"Parameters of {kind}"] = schema
        names = [kind, *(name for name, ours in NAMES_2016.items() if ours == kind)]
        reference: dict[str, Any] = {"properties": {"parameters": {"$ref": f"#/$defs/Parameters%20of%20{kind}"}}}
        if schema.get("required"):
            reference["required"] = ["parameters"]
        rules.append(
            {
                "if": {"properties": {"type": {"enum": names}}},
                "then": reference,
            }
        )
    definitions["AgentEntry"]["allOf"] = rules
    known = [*KINDS, *(name for name, _ in NAMES_2016.items())]
    for entry in ("AgentEntry0", "AgentEntry"):
        if entry in definitions:
            definitions[entry]["properties"]["type"]["anyOf"] = [{"enum": known}, {"pattern": PROGRAM}]


def _trial_data() -> dict[str, Any]:
    schema = _of(TrialData)
    parts = {name: build for name, build in _DOCUMENTS.items() if name in {"configuration", "instance"}}
    schema["properties"]["trialconf"] = {"$ref": ID + "configuration"}
    schema["properties"]["instances"]["items"] = {"$ref": ID + "instance"}
    schema["$defs"] = {name: build() for name, build in parts.items()}
    return _complete(schema, "trial-data", "Trial data")


def _complete(schema: dict[str, Any], name: str, title: str) -> dict[str, Any]:
    return {"$schema": DIALECT, "$id": ID + name, **schema, "title": title}


_DOCUMENTS: Mapping[str, Callable[[], dict[str, Any]]] = {
    "network": lambda: _complete(_road_network(), "network", "Road network description (RND)"),
    "configuration": lambda: _versions("configuration", "Trials configuration", Settings0, Settings, [_ROADS_ONCE]),
    "instance": lambda: _versions("instance", "Problem instance", InstanceModel0, InstanceModel, []),
    "trial-data": _trial_data,
}


if __name__ == "__main__":
    for (each_room, each), made in schemas().items():
        place(each_room, each).write_text(text(made), encoding="utf-8")
