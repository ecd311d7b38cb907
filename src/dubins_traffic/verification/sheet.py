"""Score sheets: what `run --json` printed of records, read again, and found where it lies beside a record."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path, PurePath
from typing import Any, TypeAlias, cast

from dubins_traffic.errors import InputError
from dubins_traffic.files import read_text
from dubins_traffic.problem.files import parse_json

BESIDE = "scores.json"
"""Name of a score sheet that is checked, unasked, with the records in its folder."""
Scores: TypeAlias = Sequence[Mapping[str, Any]]


def read_sheet(file: str) -> Scores:
    """Return the scores in a file.

    Raises
    ------
    InputError
        If it can't be read, or is no score sheet.
    """
    trials = parse_json(read_text(file), file).get("trials")
    if isinstance(trials, list):
        entries = cast("list[Any]", trials)
        if all(isinstance(entry, dict) for entry in entries):
            return cast("list[dict[str, Any]]", entries)
    raise InputError("no scores", file=file, field="trials", expected="what `run --json` prints")


def entry_of(record: str, scores: Scores) -> Mapping[str, Any] | None:
    """Return the score that names the file of a record, None if there is none."""
    name = PurePath(record).name
    return next((one for one in scores if PurePath(str(one.get("record"))).name == name), None)


def sheet_beside(record: Path) -> tuple[Path, Scores] | None:
    """Return the score sheet beside a record, and its scores; None if there is none, or it does not name the record.

    Raises
    ------
    InputError
        If there is a file of that name that is no score sheet.
    """
    path = record.with_name(BESIDE)
    if not path.is_file():
        return None
    scores = read_sheet(str(path))
    return None if entry_of(record.name, scores) is None else (path, scores)
