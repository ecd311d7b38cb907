"""The table of a campaign, and that of its wall-clock figures: merged from parts, sorted by number."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from dubins_traffic.campaign import rows
from dubins_traffic.campaign.campaign import Campaign
from dubins_traffic.campaign.chunks import Cell
from dubins_traffic.campaign.notice import fault_notice
from dubins_traffic.controllers.registry import ran
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.record.sink import FAULTS
from dubins_traffic.scoring.metric import Column

RESULTS = "results.parquet"
WALL = "wall.parquet"
GROUP = 65_536
"""Rows in a row group; constant, so that the bytes don't depend on how the work was cut."""
FACTOR = "factor."


class TableKind(Enum):
    """Which of the two tables."""

    RESULTS = "results"
    WALL = "wall"


def is_part(path: Path, count: int, metrics: Sequence[Column] = ()) -> bool:
    """Tell whether the file at `path` is a whole part of `count` rows, with the columns of further metrics."""
    made = rows.arrow()
    try:
        parquet = made.parquet.ParquetFile(path)
    except (OSError, made.ArrowInvalid):
        return False
    names = rows.part_schema(metrics).names
    return parquet.metadata.num_rows == count and parquet.schema_arrow.names == names


def merge(campaign: Campaign, parts: Sequence[Path], kind: TableKind, target: Path) -> None:
    """Write one of the tables from its parts, given in order; holds a row group and a part in memory.

    Raises
    ------
    OSError
        If the file can't be written.
    InputError
        If the parts are not all trials of the campaign, each once.
    """
    made = rows.arrow()
    schema = _schema(campaign, kind)
    count = 0
    with made.parquet.ParquetWriter(target, schema, compression=rows.COMPRESSION) as writer:
        for group in _groups(campaign, parts, kind):
            numbers = group["number"].to_numpy()
            if not np.array_equal(numbers, np.arange(count, count + len(numbers))):
                raise InputError("rows are missing or stand twice", file=str(target.parent), value=count)
            count += len(numbers)
            writer.write_table(group, row_group_size=GROUP)
    if count != campaign.total:
        raise InputError("not all trials have rows", file=str(target.parent), value=count, expected=str(campaign.total))


def read(folder: Path, campaign: Campaign, parts: Sequence[Path], kind: TableKind = TableKind.RESULTS) -> Any:
    """Return a table of a campaign, an Arrow table; of one that is not finished the rows that there are."""
    made = rows.arrow()
    whole = folder / (RESULTS if kind is TableKind.RESULTS else WALL)
    try:
        if whole.is_file():
            table = made.parquet.read_table(whole)
            if table.schema.names != _schema(campaign, kind).names:
                expected = "the table of a campaign that was run with this version of dubins-traffic"
                raise InputError("has other columns", file=str(whole), expected=expected)
            return table
        empty = _schema(campaign, kind).empty_table()
        return made.concat_tables([empty, *(shaped(campaign, _load(part), kind) for part in parts)])
    except (OSError, made.ArrowInvalid) as error:
        raise InputError(f"can't be read ({error})", file=str(whole)) from None


def faulty(folder: Path) -> str:
    """Return the notice that trials of a finished campaign failed or ended by a fault; empty if none did."""
    made = rows.arrow()
    compute: Any = made.compute
    table = made.parquet.read_table(folder / RESULTS, columns=["number", "controller", "end", "reason"])
    bad = table.filter(compute.is_in(table["end"], made.array(sorted(FAULTS | rows.NOTHING))))
    if not len(bad):
        return ""
    first = bad.slice(0, 1).to_pylist()[0]
    told = f"trial {first['number']} with {first['controller']}: {first['end']}: {first['reason']}"
    return fault_notice(Counter(bad["end"].to_pylist()), len(table), told)


def assumption(folder: Path) -> tuple[int, int]:
    """Return the number of judged trials of a finished campaign in which e-agents broke the assumption, and of all."""
    table = rows.arrow().parquet.read_table(folder / RESULTS, columns=["assumption_broken"])
    known = table["assumption_broken"].drop_null().to_pylist()
    return sum(known), len(known)


def _groups(campaign: Campaign, parts: Sequence[Path], kind: TableKind) -> Iterator[Any]:
    """Return the rows of `parts` in tables of `GROUP` rows, the last with what is left."""
    made = rows.arrow()
    waiting: list[Any] = []
    count = 0
    for part in parts:
        waiting.append(shaped(campaign, _load(part), kind))
        count += len(waiting[-1])
        while count >= GROUP:
            joined = made.concat_tables(waiting).combine_chunks()
            yield joined.slice(0, GROUP).combine_chunks()
            waiting, count = [joined.slice(GROUP)], count - GROUP
    if count or not parts:
        yield made.concat_tables(waiting).combine_chunks()


def _load(part: Path) -> Any:
    return rows.arrow().parquet.read_table(part)


def _schema(campaign: Campaign, kind: TableKind) -> Any:
    made = rows.arrow()
    part = rows.part_schema(campaign.columns)
    if kind is TableKind.WALL:
        return made.schema([part.field(name) for name in ("number", *rows.WALL)])
    identity = [("number", made.int64()), ("cell", made.int32()), ("configuration", made.string())]
    identity += [(FACTOR + name, _type(campaign, name)) for name in campaign.factors]
    identity += [("controller", made.string()), ("ran", made.string())]
    identity += [("trial", made.int64()), ("seed", made.uint64())]
    rest = [part.field(name) for name in rows.results(campaign.columns) if name != "number"]
    return made.schema([*(made.field(*one) for one in identity), *rest])


def _type(campaign: Campaign, factor: str) -> Any:
    made = rows.arrow()
    kinds = {type(cell.values[factor]) for cell in campaign.cells}
    if kinds == {bool}:
        return made.bool_()
    if kinds == {int}:
        return made.int64()
    return made.float64() if kinds <= {int, float} else made.string()


def shaped(campaign: Campaign, part: Any, kind: TableKind) -> Any:
    """Return rows of a part as rows of a table of a campaign: with the columns that say which trials they are."""
    made = rows.arrow()
    schema = _schema(campaign, kind)
    if kind is TableKind.WALL:
        return part.select(schema.names).cast(schema)
    cells, controllers, trials = places(campaign, part["number"].to_numpy())
    chosen_cells: list[Cell] = [campaign.cells[k] for k in cells.tolist()]
    whose: list[int] = controllers.tolist()
    known: dict[str, list[Any]] = {
        "cell": cells.tolist(),
        "configuration": [cell.configuration for cell in chosen_cells],
        "controller": [campaign.controllers[k] for k in whose],
        "ran": [ran(campaign.places[k]) for k in whose],
        "trial": trials.tolist(),
        "seed": [cell.seed for cell in chosen_cells],
    }
    for name in campaign.factors:
        values = [cell.values[name] for cell in chosen_cells]
        text = schema.field(FACTOR + name).type == made.string()
        known[FACTOR + name] = [factor_text(value) for value in values] if text else values
    arrays = [
        made.array(known[entry.name], type=entry.type) if entry.name in known else part[entry.name] for entry in schema
    ]
    return made.Table.from_arrays(arrays, schema=schema)


def factor_text(value: object) -> str:
    """Return the value of a factor as a text; switches as in JSON."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def places(campaign: Campaign, numbers: Ints) -> tuple[Ints, Ints, Ints]:
    """Return the cell, the controller and the number within these of each trial of a campaign."""
    first = np.array([cell.first for cell in campaign.cells])
    count = np.array([cell.count for cell in campaign.cells])
    cells = np.searchsorted(first, numbers, side="right") - 1
    within = numbers - first[cells]
    return cells, within // count[cells], within % count[cells]
