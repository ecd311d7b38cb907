"""The JSON Schema of the competition file: generated from the models, shipped beside them.

``python -m dubins_traffic.competition.schema`` writes it anew. The file is TOML; the schema describes what it says.
"""

from __future__ import annotations

from typing import Any

from dubins_traffic.competition.competition import CompetitionModel
from dubins_traffic.problem.schema import shipped_schema, with_configurations, write_schema

NAME = "competition"


def competition_schema() -> dict[str, Any]:
    """Return the schema of competition files."""
    return with_configurations(CompetitionModel, NAME)


def shipped_competition_schema() -> dict[str, Any]:
    """Return the shipped schema."""
    return shipped_schema(NAME, NAME)


if __name__ == "__main__":
    write_schema(NAME, NAME, competition_schema())
