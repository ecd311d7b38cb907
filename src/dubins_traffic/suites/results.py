"""Files of a suite's results: made from a campaign's folder, and read from any path."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from dubins_traffic.campaign import manifest, rows, table
from dubins_traffic.campaign.campaign import Campaign
from dubins_traffic.controllers.registry import ran
from dubins_traffic.errors import InputError
from dubins_traffic.files import is_file, read_text, write_text
from dubins_traffic.problem.faults import parse
from dubins_traffic.problem.files import parse_json
from dubins_traffic.release import sources_hash
from dubins_traffic.scoring.registry import STRATEGY_SHARE
from dubins_traffic.scoring.verdict import Ruling
from dubins_traffic.suites.result_model import FORMAT, WALL_FORMAT, ResultModel, WallModel
from dubins_traffic.suites.suite import Suite

WALL = ".wall.json"
KEPT = tuple(name for name in rows.RESULT if name not in ("number", "reason"))
"""Columns of a campaign's table that a file of results has; a reason may name what is private to a machine."""


def file_name(suite: Suite, trials: int | None) -> str:
    """Return the name of a file of results: the hash is in it, and the number of trials if some were left out."""
    fewer = "" if trials in (None, suite.trials) else f"-trials{trials}"
    return f"{suite.label}{fewer}.json"


def save_trials(suite: Suite, campaign: Campaign, folder: Path) -> Path:
    """Write the results of a finished campaign beside its table, with the seconds in a file of their own.

    Returns
    -------
    path : Path
        The file of results.
    """
    known = manifest.read(folder) or {}
    found = table.read(folder, campaign, [])
    clock = table.read(folder, campaign, [], table.Kind.WALL)
    entries: list[dict[str, Any]] = []
    seconds: dict[str, dict[str, Any]] = {}
    for k, name in enumerate(campaign.controllers):
        own = [place for place, one in enumerate(found["controller"].to_pylist()) if one == name]
        picked, times = found.take(own), clock.take(own)
        share = [STRATEGY_SHARE] if STRATEGY_SHARE in found.column_names else []
        columns = played({column: picked[column].to_pylist() for column in (*KEPT, *share)})
        file, where = known["controllers"][k]["file"], ran(campaign.places[k])
        entries.append({"controller": name, "file": file, "ran": where, "columns": columns})
        seconds[name] = {column: times[column].to_pylist() for column in rows.WALL}
    return save(suite, folder, {"trials": campaign.model.trials, "entries": entries}, {"entries": seconds})


def played(columns: Mapping[str, Sequence[Any]]) -> dict[str, Sequence[Any]]:
    """Return the columns of an entry without that of a strategy's share where the ego played none."""
    return {
        name: values
        for name, values in columns.items()
        if name != STRATEGY_SHARE or any(value is not None for value in values)
    }


def save(suite: Suite, folder: Path, found: Mapping[str, Any], seconds: Mapping[str, Any]) -> Path:
    """Write a file of results and that of the seconds; return the path of the first."""
    document: dict[str, Any] = {
        "format": FORMAT,
        "version": 0,
        "suite": suite.name,
        "hash": suite.hash,
        "trials": None,
        "package": manifest.package_version(),
        "code": sources_hash(),
        **found,
    }
    path = folder / file_name(suite, document["trials"])
    clock = {"format": WALL_FORMAT, "version": 0, "hash": suite.hash, **seconds}
    write_text(wall_path(path), _text(clock))
    write_text(path, _text(document))
    return path


def wall_path(path: Path) -> Path:
    """Return where the seconds stand beside a file of results."""
    return path.with_name(path.name.removesuffix(".json") + WALL)


def find_results(place: str) -> Path:
    """Return the file of results that a path names: itself, or the only one in a folder; InputError otherwise."""
    path = Path(place)
    if not path.is_dir():
        return path
    found = [each for each in sorted(path.glob("*.json")) if _is_result(each)]
    if len(found) != 1:
        problem = "several files of results" if found else "no results of a suite"
        raise InputError(
            problem, file=place, expected="the folder of `suite run` when it is finished, or a file"
        )
    return found[0]


def _is_result(path: Path) -> bool:
    if path.name.endswith(WALL):
        return False
    with path.open("rb") as stream:
        return f'"format": "{FORMAT}"'.encode() in stream.read(200)


def load_results(path: Path) -> tuple[ResultModel, WallModel | None]:
    """Return the results in a file, and the seconds beside it if they are there.

    Raises
    ------
    InputError
        If a file can't be read, or is not as its schema says.
    """
    found = parse(ResultModel, parse_json(read_text(path), str(path)), file=str(path))
    beside = wall_path(path)
    if not is_file(beside):
        return found, None
    wall = parse(WallModel, parse_json(read_text(beside), str(beside)), file=str(beside))
    if wall.hash != found.hash:
        raise InputError(
            "seconds of another suite", file=str(beside), field="hash", value=wall.hash, expected=found.hash
        )
    return found, wall


def part(
    columns: Mapping[str, Sequence[Any]], seconds: Mapping[str, Sequence[Any]] | None, numbers: Sequence[int]
) -> Any:
    """Return trials of a file of results as a part of a campaign's table, an Arrow table.

    Parameters
    ----------
    columns : Mapping
        Their results, the columns `KEPT`.
    seconds : Mapping or None
        The wall-clock figures, if there are any.
    numbers : sequence of int
        The numbers of the trials in that campaign.

    Raises
    ------
    InputError
        If a column is missing, has another length or values of another kind; names it.
    """
    made = rows.arrow()
    count = len(numbers)
    blank = [None] * count
    known: dict[str, Sequence[Any]] = {
        **dict.fromkeys(rows.WALL, blank),
        **(seconds or {}),
        **columns,
        "number": numbers,
        "reason": blank,
    }
    arrays: list[Any] = []
    for entry in rows.part_schema():
        values = known.get(entry.name)
        if values is None or len(values) != count:
            problem = "a column is missing" if values is None else "a column of another length"
            raise InputError(problem, field=f"columns.{entry.name}", expected=f"{count} values")
        _check_words(entry.name, values)
        try:
            arrays.append(made.array(values, type=entry.type))
        except (made.ArrowInvalid, made.ArrowTypeError, OverflowError) as error:
            raise InputError(
                f"a column of other values ({error})", field=f"columns.{entry.name}", expected=str(entry.type)
            ) from None
    return made.Table.from_arrays(arrays, schema=rows.part_schema())


def _check_words(column: str, values: Sequence[Any]) -> None:
    """Refuse a trial that ended in no way at all, or whose verdict is none."""
    wrong = [value for value in values if not _is_word(column, value)]
    if wrong:
        expected = ", ".join(Ruling) + " or null" if column == "verdict" else "how each trial ended"
        raise InputError(
            "a column of other values", field=f"columns.{column}", value=wrong[0], expected=expected
        )


def _is_word(column: str, value: object) -> bool:
    if column == "verdict":
        return value is None or value in list(Ruling)
    return column != "end" or (isinstance(value, str) and bool(value))


def _text(document: Mapping[str, Any]) -> str:
    return json.dumps(document, allow_nan=False) + "\n"
