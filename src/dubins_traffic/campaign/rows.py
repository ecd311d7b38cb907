"""The rows of a campaign's table: one a trial, with what came of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from io import BytesIO
from typing import Any, TypeAlias

from dubins_traffic.campaign.columns import SCORES
from dubins_traffic.errors import needs
from dubins_traffic.record.sink import Ending
from dubins_traffic.scoring.metric import Column
from dubins_traffic.scoring.score import Score

Row: TypeAlias = dict[str, Any]
Columns: TypeAlias = Mapping[str, Sequence[Any]]
"""Name to values, one a trial, all of one length: lists or arrays."""

FAILED = "failed"
"""End of a trial that could not be run or scored; its reason tells the error."""
CRASHED = "crashed"
"""End of a trial that ends its process whenever it is run."""
NOTHING = frozenset({FAILED, CRASHED})
"""Ends of trials that came to nothing."""
LONGEST_REASON = 500
COMPRESSION = "zstd"


_ACTS = {"act_mean_s": "mean", "act_p99_s": "p99", "act_max_s": "max"}
WALL = ("time_to_begin_s", *_ACTS)
"""What was measured on a wall clock, kept in a table of its own."""

RESULT = ("number", "end", "reason", *SCORES)
"""Columns of the table of results that come from running a trial."""


def row(number: int, ending: Ending, score: Score, act_s: Mapping[str, float]) -> Row:
    """Return the row of a trial that was run and scored, and of which `act_s` sums up the latencies of `act`."""
    return {
        "number": number,
        "end": ending.end.value,
        "reason": ending.detail[:LONGEST_REASON] or None,
        **{name: kind.of(score) for name, kind in SCORES.items()},
        **{metric.column.name: metric.value for metric in score.metrics},
        "time_to_begin_s": score.time_to_begin_s,
        **{name: act_s.get(figure) for name, figure in _ACTS.items()},
    }


def failure(number: int, end: str, reason: str, metrics: Sequence[Column] = ()) -> Row:
    """Return the row of a trial that came to nothing, and why; `metrics` are the columns of further metrics."""
    rest = dict.fromkeys([*SCORES, *(metric.name for metric in metrics), *WALL])
    return {"number": number, "end": end, "reason": reason[:LONGEST_REASON], **rest}


def columns(rows: Sequence[Row], metrics: Sequence[Column] = ()) -> Columns:
    """Return rows as columns, with those of further metrics."""
    return {name: [one[name] for one in rows] for name in (*results(metrics), *WALL)}


def results(metrics: Sequence[Column]) -> tuple[str, ...]:
    """Return the columns of the table of results that come from running a trial, with those of further metrics."""
    return (*RESULT, *(metric.name for metric in metrics))


def arrow() -> Any:
    """Return pyarrow.

    Raises
    ------
    MissingExtraError
        Without the extra `campaign`.
    """
    with needs("a campaign", "campaign"):
        import_module("pyarrow.parquet")
        import_module("pyarrow.compute")
        return import_module("pyarrow")


def part_schema(metrics: Sequence[Column] = ()) -> Any:
    """Return the Arrow schema of a part: what comes from running trials, with the columns of further metrics."""
    made = arrow()
    types = {"number": "int64", "end": "string", "reason": "string"}
    types |= {name: kind.column.kind for name, kind in SCORES.items()}
    types |= {metric.name: metric.kind for metric in metrics}
    types |= dict.fromkeys(WALL, "float64")
    names = {"bool": "bool_", "string": "string"}
    return made.schema([(name, getattr(made, names.get(kind, kind))()) for name, kind in types.items()])


def answer_s(part: bytes) -> float | None:
    """Return how long an answer took in the trials of a part, seconds, on average; None if nobody was asked."""
    column = arrow().parquet.read_table(BytesIO(part), columns=["act_mean_s"])["act_mean_s"]
    return arrow().compute.mean(column).as_py()


def encoded(columns: Columns, metrics: Sequence[Column] = ()) -> bytes:
    """Return the rows of a chunk as the bytes of its Parquet file, a part of the campaign's table."""
    made = arrow()
    schema = part_schema(metrics)
    arrays = [made.array(columns[entry.name], type=entry.type) for entry in schema]
    stream = BytesIO()
    table = made.Table.from_arrays(arrays, schema=schema)
    made.parquet.write_table(table, stream, compression=COMPRESSION)
    return stream.getvalue()
