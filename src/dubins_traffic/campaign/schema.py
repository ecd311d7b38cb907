"""The JSON Schema of the campaign file: generated from the models, shipped beside them.

``python -m dubins_traffic.campaign.schema`` writes it anew. The file is TOML; the schema describes what it says.
"""

from __future__ import annotations

from typing import Any

from dubins_traffic.campaign.settings import CampaignModel
from dubins_traffic.problem.schema import shipped_schema, with_configurations, write_schema

NAME = "campaign"


def campaign_schema() -> dict[str, Any]:
    """Return the schema of campaign files."""
    return with_configurations(CampaignModel, NAME)


def shipped_campaign_schema() -> dict[str, Any]:
    """Return the shipped schema."""
    return shipped_schema(NAME, NAME)


if __name__ == "__main__":
    write_schema(NAME, NAME, campaign_schema())
