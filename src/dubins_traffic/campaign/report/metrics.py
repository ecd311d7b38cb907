"""The metrics that a report compares: what they are called and how they are told."""

from __future__ import annotations

from collections.abc import Mapping

from dubins_traffic.scoring.metric import Column

METRICS = (
    Column("clean", "clean", "share", 1),
    Column("counted_rounds", "counted rounds", better=1),
    Column("rounds", "rounds", better=1),
    Column("goals_visited", "goals visited", "share", 1),
    Column("longest_gap_s", "longest gap between visits", "s", -1),
    Column("breaches", "breaches of the ego", better=-1),
    Column("breaches_of_others", "breaches of others"),
    Column("assumption_broken", "assumption broken by others", "share"),
    Column("collisions", "collisions", better=-1),
    Column("collisions_ego_fault", "collisions, the ego's fault", better=-1),
    Column("collisions_other_fault", "collisions, the other's fault"),
    Column("collisions_both_fault", "collisions, the fault of both", better=-1),
    Column("collisions_among_others", "collisions among others"),
    Column("min_clearance_m", "least clearance", "m", 1),
    Column("distance_m", "distance", "m"),
    Column("standing_share", "standing", "share", -1),
    Column("off_road_s", "off the road", "s", -1),
    Column("off_road_share", "off the road", "share", -1),
    Column("lane_departures", "lane departures", better=-1),
    Column("interventions", "interventions of a shield", "ticks", -1, rare=True),
    Column("duration_s", "duration", "s"),
    Column("paper_score", "score of the paper", better=1),
    Column("icra2016", "ICRA 2016, counts samples", better=1, bounded=True),
)
"""The metrics of the table, in the order of a report: what ranks controllers first, the score of 2016 last."""

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
