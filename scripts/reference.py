"""The parts of `docs/documents.md` and `docs/competitions/file.md` that are read off the code.

``python -m scripts.reference PAGE...`` renews them.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Sequence
from typing import Any

from pydantic import BaseModel

from dubins_traffic.cli import catalogue
from dubins_traffic.cli.catalogue import Parameter
from dubins_traffic.competition.competition import CompetitionModel, LimitsTable, PhaseModel, Quota, Ranking
from dubins_traffic.competition.submission import Manifest
from dubins_traffic.errors import InputError
from dubins_traffic.files import read_text, write_text

_PART = re.compile(r"(<!-- generated: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
"""A part of a page between two marks."""


_TABLES: dict[str, type[BaseModel]] = {
    "The competition": CompetitionModel,
    "`[ranking]`": Ranking,
    "`[phases.NAME]`": PhaseModel,
    "`limits` of a phase": LimitsTable,
    "`quota` of a phase": Quota,
    "`controller.toml` of a submission": Manifest,
}


def _competition_tables() -> dict[str, tuple[Parameter, ...]]:
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


def renewed(page: str) -> str:
    """Return a page with its generated parts as the code has them now.

    Raises
    ------
    InputError
        If a part is of nothing that there is.
    """
    return _PART.sub(lambda match: f"{match[1]}\n{_part(match[2])}\n\n{match[3]}", page)


def _part(name: str) -> str:
    match name:
        case "agents":
            parts = [f"**`{own.name}`**: {own.line}" + _more(own.remarks, own.parameters) for own in catalogue.agents()]
            return "\n\n".join(parts)
        case "rules":
            return "\n".join(_table(catalogue.rules()))
        case "competition":
            parts = [
                f"### {heading}\n\n" + "\n".join(_table(rows, "key")) for heading, rows in _competition_tables().items()
            ]
            return "\n\n".join(parts)
        case "configurations" | "controllers" | "simulators":
            entries = getattr(catalogue, name)()
            return "\n".join(
                ["| name | what it is |", "|---|---|", *(f"| `{own.name}` | {own.line} |" for own in entries)]
            )
        case _:
            raise InputError("no such part", value=name)


def _more(remarks: Iterable[str], parameters: Sequence[Parameter]) -> str:
    text = "".join(f" ({remark})" for remark in remarks)
    return text + ("\n\n" + "\n".join(_table(parameters)) if parameters else "")


def _table(parameters: Iterable[Parameter], what: str = "parameter") -> list[str]:
    rows = [f"| `{own.name}` | {own.shown} | {own.meaning} |" for own in parameters]
    return [f"| {what} | default | meaning |", "|---|---|---|", *rows]


if __name__ == "__main__":
    for place in sys.argv[1:]:
        write_text(place, renewed(read_text(place)))
