"""The JSON Schemas of suites and of their results: generated from the models, shipped beside them.

``python -m dubins_traffic.suites.schema`` writes them anew.
"""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel

from dubins_traffic.problem.schema import DIALECT, ID, shipped_schema, with_configurations, write_schema
from dubins_traffic.suites.results import ResultModel
from dubins_traffic.suites.suite import SuiteModel

SUITE = "suite"
RESULT = "suite-result"
ROOM = "suites"


def suite_schema() -> dict[str, Any]:
    """Return the schema of suites' files."""
    return with_configurations(SuiteModel, SUITE)


def result_schema() -> dict[str, Any]:
    """Return the schema of files of results."""
    return _plain(ResultModel, RESULT)


def shipped_suite_schemas() -> dict[str, dict[str, Any]]:
    """Return the shipped schemas by name."""
    return {name: shipped_schema(name, ROOM) for name in (SUITE, RESULT)}


def _plain(model: type[BaseModel], name: str) -> dict[str, Any]:
    return {"$schema": DIALECT, "$id": ID + name, **model.model_json_schema(), "title": "Results of a suite"}


if __name__ == "__main__":
    write_schema(ROOM, SUITE, suite_schema())
    write_schema(ROOM, RESULT, result_schema())
