"""The JSON Schema of the competition file: generated from the models, shipped beside them.

``python -m dubins_traffic.competition.schema`` writes it anew. The file is TOML; the schema describes what it says.
"""

from __future__ import annotations

import json
from importlib.resources import files
from pathlib import Path
from typing import Any

from dubins_traffic.competition.settings import CompetitionModel
from dubins_traffic.problem.schema import DIALECT, ID, schema_text

NAME = "competition"


def competition_schema() -> dict[str, Any]:
    """Return the schema of competition files; its configurations refer to the schema of configurations."""
    schema = CompetitionModel.model_json_schema()
    document = schema["$defs"]["ConfigurationEntry"]["properties"]["document"]
    document["anyOf"][0] = {"$ref": ID + "configuration"}
    schema["properties"]["version"] = {"const": 0, "description": "0"}
    return {"$schema": DIALECT, "$id": ID + NAME, **schema, "title": "Competition"}


def shipped_competition_schema() -> dict[str, Any]:
    """Return the shipped schema."""
    item = files("dubins_traffic.competition") / "schemas" / f"{NAME}.json"
    return json.loads(item.read_text(encoding="utf-8"))


def _write() -> None:
    path = Path(__file__).parent / "schemas" / f"{NAME}.json"
    path.write_text(schema_text(competition_schema()), encoding="utf-8")


if __name__ == "__main__":
    _write()
