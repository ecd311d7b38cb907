"""The rows of a campaign's table: one a trial, with what came of it."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from io import BytesIO
from typing import TYPE_CHECKING, Any, TypeAlias

from dubins_traffic.errors import MissingExtraError
from dubins_traffic.record.sink import Ending
from dubins_traffic.scoring.metric import Column
from dubins_traffic.scoring.score import Score
from dubins_traffic.scoring.verdict import ASSUMPTIONS, EGO_RULES, assumption_of

if TYPE_CHECKING:
    from dubins_traffic.scoring.collisions import Collision

Row: TypeAlias = dict[str, Any]
Columns: TypeAlias = Mapping[str, Sequence[Any]]
"""Name to values, one a trial, all of one length: lists or arrays."""

FAILED = "failed"
"""End of a trial that could not be run or scored; its reason tells the error."""
CRASHED = "crashed"
"""End of a trial that ends its process whenever it is run."""
LONGEST_REASON = 500
COMPRESSION = "zstd"


def _ego_fault(one: Collision) -> bool:
    return one.at_fault and not one.partner_at_fault


def _other_fault(one: Collision) -> bool:
    return one.partner_at_fault and not one.at_fault


def _both_fault(one: Collision) -> bool:
    return one.at_fault and one.partner_at_fault


def _breaches(score: Score, *, ego: bool) -> int | None:
    verdict = score.verdict
    return None if verdict is None else sum((one.car == "ego") == ego for one in verdict.violations)


def _broken(rule: str) -> Callable[[Score], int | None]:
    def count(score: Score) -> int | None:
        verdict = score.verdict
        if verdict is None:
            return None
        return sum(one.car == "ego" and one.rule == rule for one in verdict.violations)

    return count


def _fallen(part: str) -> Callable[[Score], int | None]:
    def count(score: Score) -> int | None:
        verdict = score.verdict
        if verdict is None:
            return None
        others = (one for one in verdict.violations if one.car != "ego")
        return sum(assumption_of(one.rule) == part for one in others)

    return count


def _formulas(score: Score) -> str | None:
    """Return what holds of each formula of a user's own, JSON."""
    found = {one.name: one.verdict for one in score.formulas}
    return json.dumps(found) if found else None


SCORES: Mapping[str, tuple[str, Callable[[Score], Any]]] = {
    "duration_s": ("float64", lambda score: score.duration_s),
    "clean": ("bool", lambda score: score.verdict and score.verdict.clean),
    "counted_rounds": ("int32", lambda score: score.counted_rounds),
    "verdict": ("string", lambda score: score.verdict and score.verdict.verdict.value),
    "near": ("bool", lambda score: score.verdict and score.verdict.near),
    "assumption_broken": ("bool", lambda score: score.verdict and score.verdict.assumption_broken),
    "rounds": ("int32", lambda score: score.rounds),
    "goals_visited": ("float64", lambda score: score.goals_visited),
    "longest_gap_s": ("float64", lambda score: max((g.longest_gap_s for g in score.goals), default=None)),
    "distance_m": ("float64", lambda score: score.driven.distance_m),
    "standing_share": ("float64", lambda score: score.driven.standing_share),
    "off_road_s": ("float64", lambda score: score.driven.off_road_s),
    "off_road_share": ("float64", lambda score: score.driven.off_road_share),
    "lane_departures": ("int32", lambda score: score.driven.lane_departures),
    "min_clearance_m": ("float64", lambda score: score.min_clearance_m),
    "collisions": ("int32", lambda score: len(score.collisions)),
    "collisions_ego_fault": ("int32", lambda score: sum(map(_ego_fault, score.collisions))),
    "collisions_other_fault": ("int32", lambda score: sum(map(_other_fault, score.collisions))),
    "collisions_both_fault": ("int32", lambda score: sum(map(_both_fault, score.collisions))),
    "collisions_among_others": ("int32", lambda score: score.collisions_among_others),
    "excuse": (
        "string",
        lambda score: score.verdict and score.verdict.excuse and score.verdict.excuse.assumption,
    ),
    "excuse_sensed": (
        "bool",
        lambda score: score.verdict and score.verdict.excuse and score.verdict.excuse.sensed,
    ),
    "interventions": ("int32", lambda score: score.interventions),
    "formulas": ("string", _formulas),
    "breaches": ("int32", lambda score: _breaches(score, ego=True)),
    "breaches_of_others": ("int32", lambda score: _breaches(score, ego=False)),
    **{f"breaches.{rule}": ("int32", _broken(rule)) for rule in EGO_RULES},
    **{f"breaches_of_others.{part}": ("int32", _fallen(part)) for part in ASSUMPTIONS},
    "paper_score": ("float64", lambda score: score.paper_score),
    "icra2016": ("float64", lambda score: score.icra2016),
}
"""What is kept of a score: column, its type in Arrow, and its value; null where a score has none."""

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
        **{name: value(score) for name, (_, value) in SCORES.items()},
        **{own.column.name: own.value for own in score.metrics},
        "time_to_begin_s": score.time_to_begin_s,
        **{name: act_s.get(figure) for name, figure in _ACTS.items()},
    }


def failure(number: int, end: str, reason: str, metrics: Sequence[Column] = ()) -> Row:
    """Return the row of a trial that came to nothing, and why; `metrics` are the columns of further metrics."""
    rest = dict.fromkeys([*SCORES, *(own.name for own in metrics), *WALL])
    return {"number": number, "end": end, "reason": reason[:LONGEST_REASON], **rest}


def columns(rows: Sequence[Row], metrics: Sequence[Column] = ()) -> Columns:
    """Return rows as columns, with those of further metrics."""
    return {name: [one[name] for one in rows] for name in (*results(metrics), *WALL)}


def results(metrics: Sequence[Column]) -> tuple[str, ...]:
    """Return the columns of the table of results that come from running a trial, with those of further metrics."""
    return (*RESULT, *(own.name for own in metrics))


def arrow() -> Any:
    """Return pyarrow.

    Raises
    ------
    MissingExtraError
        Without the extra `campaign`.
    """
    try:
        found = import_module("pyarrow")
        import_module("pyarrow.parquet")
        import_module("pyarrow.compute")
    except ImportError as error:
        raise MissingExtraError("a campaign", "campaign") from error
    return found


def part_schema(metrics: Sequence[Column] = ()) -> Any:
    """Return the Arrow schema of a part: what comes from running trials, with the columns of further metrics."""
    made = arrow()
    types = {"number": "int64", "end": "string", "reason": "string"}
    types |= {name: kind for name, (kind, _) in SCORES.items()}
    types |= {own.name: own.kind for own in metrics}
    types |= dict.fromkeys(WALL, "float64")
    names = {"bool": "bool_", "string": "string"}
    return made.schema([(name, getattr(made, names.get(kind, kind))()) for name, kind in types.items()])


def encoded(found: Columns, metrics: Sequence[Column] = ()) -> bytes:
    """Return the rows of a chunk as the bytes of its Parquet file, a part of the campaign's table."""
    made = arrow()
    schema = part_schema(metrics)
    arrays = [made.array(found[entry.name], type=entry.type) for entry in schema]
    stream = BytesIO()
    table = made.Table.from_arrays(arrays, schema=schema)
    made.parquet.write_table(table, stream, compression=COMPRESSION)
    return stream.getvalue()
