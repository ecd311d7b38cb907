"""The metrics that a report compares: their names, units, and how their numbers are written."""

from __future__ import annotations

from collections.abc import Mapping

from dubins_traffic.scoring.metric import Column

WALL_METRICS = (
    Column("time_to_begin_s", "time to begin, wall clock", "s", -1),
    Column("act_mean_s", "time to act, mean, wall clock", "s", -1),
    Column("act_p99_s", "time to act, 99 %, wall clock", "s", -1),
    Column("act_max_s", "time to act, longest, wall clock", "s", -1),
)
"""What was measured on a wall clock."""

FAULTS: Mapping[str, str] = {
    "collisions_ego_fault": "the ego",
    "collisions_other_fault": "the other",
    "collisions_both_fault": "both",
}
"""Collisions of the ego by who was at fault."""


def shown(value: float | None) -> str:
    """Return a number as people read it: four digits that count."""
    return "\N{EN DASH}" if value is None else f"{value:.4g}"


def words(name: str) -> str:
    """Return the name of a factor or of an end as people write it."""
    return name.replace("e_agent", "e-agent").replace("_", " ")
