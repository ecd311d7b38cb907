"""The parts of `docs/documents.md` and `docs/competitions/file.md` that are read off the code.

``python -m dubins_traffic.cli.reference PAGE...`` renews them.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from dubins_traffic.errors import InputError
from dubins_traffic.files import read_text, write_text

if TYPE_CHECKING:
    from dubins_traffic.runs.catalogue import Parameter

_PART = re.compile(r"(<!-- generated: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
"""A part of a page between two marks."""


def renewed(page: str) -> str:
    """Return a page with its generated parts as the code has them now.

    Raises
    ------
    InputError
        If a part is of nothing that there is.
    """
    return _PART.sub(lambda match: f"{match[1]}\n{_part(match[2])}\n\n{match[3]}", page)


def _part(name: str) -> str:
    from dubins_traffic.runs import catalogue

    match name:
        case "agents":
            parts = [
                f"**`{own.name}`**: {own.line}" + _more(own.remarks, own.parameters)
                for own in catalogue.agents()
            ]
            return "\n\n".join(parts)
        case "rules":
            return "\n".join(_table(catalogue.rules()))
        case "competition":
            from dubins_traffic.competition.reference import tables

            parts = [
                f"### {heading}\n\n" + "\n".join(_table(rows, "key")) for heading, rows in tables().items()
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
