"""The columns of every score, in the orders of tables and of reports; each stands beside what it is a column of."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Final

from dubins_traffic.scoring import (
    collisions,
    counts,
    driving,
    formulas,
    goals,
    icra2016,
    interventions,
    paper,
)
from dubins_traffic.scoring.metric import Column, ScoreColumn, Value
from dubins_traffic.scoring.verdict import ASSUMPTIONS, EGO_NAME, EGO_RULES, Excuse, Verdict, assumption_of

if TYPE_CHECKING:
    from dubins_traffic.scoring.score import Score


def _of_verdict(value: Callable[[Verdict], Value]) -> Callable[[Score], Value]:
    """Return a function that takes a value from a score's verdict, None if there is no verdict."""
    return lambda score: None if score.verdict is None else value(score.verdict)


def _of_excuse(value: Callable[[Excuse], Value]) -> Callable[[Score], Value]:
    return _of_verdict(lambda verdict: None if verdict.excuse is None else value(verdict.excuse))


def _broken(rule: str) -> Callable[[Score], Value]:
    return _of_verdict(lambda verdict: sum(one.rule == rule for one in verdict.own_violations))


def _fallen(part: str) -> Callable[[Score], Value]:
    return _of_verdict(
        lambda verdict: sum(one.car != EGO_NAME and assumption_of(one.rule) == part for one in verdict.violations)
    )


_VERDICT = (
    ScoreColumn(Column("clean", "clean", "share", 1, "bool"), _of_verdict(lambda verdict: verdict.clean)),
    ScoreColumn(Column("verdict", kind="string"), _of_verdict(lambda verdict: verdict.verdict.value)),
    ScoreColumn(Column("near", kind="bool"), _of_verdict(lambda verdict: verdict.near)),
    ScoreColumn(
        Column("assumption_broken", "assumption broken by others", "share", kind="bool"),
        _of_verdict(lambda verdict: verdict.assumption_broken),
    ),
    ScoreColumn(Column("excuse", kind="string"), _of_excuse(lambda excuse: excuse.assumption)),
    ScoreColumn(Column("excuse_sensed", kind="bool"), _of_excuse(lambda excuse: excuse.sensed)),
    ScoreColumn(
        Column("breaches", "breaches of the ego", "", -1, "int32"),
        _of_verdict(lambda verdict: len(verdict.own_violations)),
    ),
    ScoreColumn(
        Column("breaches_of_others", "breaches of others", kind="int32"),
        _of_verdict(lambda verdict: len(verdict.violations) - len(verdict.own_violations)),
    ),
    *(ScoreColumn(Column(f"breaches.{rule}", kind="int32"), _broken(rule)) for rule in EGO_RULES),
    *(ScoreColumn(Column(f"breaches_of_others.{part}", kind="int32"), _fallen(part)) for part in ASSUMPTIONS),
)


_PARTS = (
    counts.COLUMNS,
    goals.COLUMNS,
    driving.COLUMNS,
    collisions.COLUMNS,
    interventions.COLUMNS,
    formulas.COLUMNS,
    _VERDICT,
    paper.COLUMNS,
    icra2016.COLUMNS,
)
_FIRST_IN_TABLES = (
    "duration_s", "clean", "counted_rounds", "verdict", "near", "assumption_broken", "rounds", "goals_visited",
    "longest_gap_s", "distance_m", "standing_share", "off_road_s", "off_road_share", "lane_departures",
    "min_clearance_m", "collisions", "collisions_ego_fault", "collisions_other_fault", "collisions_both_fault",
    "collisions_among_others", "excuse", "excuse_sensed",
)  # fmt: skip
"""Columns that come first in tables, in an order that is kept since files have it; the others follow by part."""
_FIRST_IN_REPORTS = (
    "clean", "counted_rounds", "rounds_before_breach", "rounds", "goals_visited", "longest_gap_s", "breaches",
    "breaches_of_others",
    "assumption_broken", "collisions", "collisions_ego_fault", "collisions_other_fault", "collisions_both_fault",
    "collisions_among_others", "min_clearance_m", "distance_m", "standing_share", "off_road_s", "off_road_share",
    "lane_departures", "interventions", "duration_s",
)  # fmt: skip
"""Columns that come first in reports, those that rank controllers; the others follow, the score of 2016 last."""
_KNOWN = {own.column.name: own for part in _PARTS for own in part}

SCORES: Final[Mapping[str, ScoreColumn]] = {name: _KNOWN[name] for name in (*_FIRST_IN_TABLES, *_KNOWN)}
"""The columns of every score, by name, in the order of tables; a value is None where a score has none."""
SECOND: Final = "rounds_before_breach"
"""The column that ranks controllers whose means of the first one, `counted_rounds` mostly, are equal."""
REPORTED: Final[tuple[Column, ...]] = tuple(
    _KNOWN[name].column for name in dict.fromkeys((*_FIRST_IN_REPORTS, *SCORES)) if _KNOWN[name].column.label
)
"""Those columns that have a line in reports, in that order."""
