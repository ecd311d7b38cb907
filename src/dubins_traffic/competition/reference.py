"""What a competition file and a submission's manifest may say, read off their models for the reference page."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel

from dubins_traffic.competition.competition import CompetitionModel, LimitsTable, PhaseModel, Quota, Ranking
from dubins_traffic.competition.submission import Manifest
from dubins_traffic.runs.catalogue import Parameter

_TABLES: dict[str, type[BaseModel]] = {
    "The competition": CompetitionModel,
    "`[ranking]`": Ranking,
    "`[phases.NAME]`": PhaseModel,
    "`limits` of a phase": LimitsTable,
    "`quota` of a phase": Quota,
    "`controller.toml` of a submission": Manifest,
}


def tables() -> dict[str, tuple[Parameter, ...]]:
    """Return the keys of each table, by the heading under which they are described."""
    return {heading: tuple(_rows(model)) for heading, model in _TABLES.items()}


def _rows(model: type[BaseModel]) -> list[Parameter]:
    return [
        Parameter(name, _shown(own.default), own.is_required(), own.description or "")
        for name, own in model.model_fields.items()
    ]


def _shown(default: Any) -> Any:
    """Return a default as JSON has it; a table whose keys have defaults is empty by default."""
    return {} if isinstance(default, BaseModel) else default
