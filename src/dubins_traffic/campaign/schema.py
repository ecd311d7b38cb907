"""The JSON Schema of the campaign file: generated from the models, shipped beside them.

``python -m dubins_traffic.campaign.schema`` writes it anew. The file is TOML; the schema describes what it says.
"""

from __future__ import annotations

import json
from importlib.resources import files
from pathlib import Path
from typing import Any

from dubins_traffic.campaign.settings import CampaignModel
from dubins_traffic.problem.schema import DIALECT, ID, schema_text

NAME = "campaign"


def campaign_schema() -> dict[str, Any]:
    """Return the schema of campaign files; the configurations in it refer to the schema of configurations."""
    schema = CampaignModel.model_json_schema()
    document = schema["$defs"]["ConfigurationEntry"]["properties"]["document"]
    document["anyOf"][0] = {"$ref": ID + "configuration"}
    schema["properties"]["version"] = {"const": 0, "description": "0"}
    return {"$schema": DIALECT, "$id": ID + NAME, **schema, "title": "Campaign"}


def shipped_campaign_schema() -> dict[str, Any]:
    """Return the shipped schema."""
    item = files("dubins_traffic.campaign") / "schemas" / f"{NAME}.json"
    return json.loads(item.read_text(encoding="utf-8"))


def _write() -> None:
    folder = Path(__file__).parent / "schemas"
    folder.mkdir(exist_ok=True)
    (folder / f"{NAME}.json").write_text(schema_text(campaign_schema()), encoding="utf-8")


if __name__ == "__main__":
    _write()
