"""The columns of every score, in the orders of tables and of reports; each stands beside what it is a column of."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from dubins_traffic.campaign import verdict_columns
from dubins_traffic.scoring import (
    collisions,
    driving,
    duration,
    formulas,
    goals,
    icra2016,
    interventions,
    paper,
)
from dubins_traffic.scoring.metric import Column, ScoreColumn

_PARTS = (
    duration.COLUMNS,
    goals.COLUMNS,
    driving.COLUMNS,
    collisions.COLUMNS,
    interventions.COLUMNS,
    formulas.COLUMNS,
    verdict_columns.COLUMNS,
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
