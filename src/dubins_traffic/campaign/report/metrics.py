"""The metrics that a report compares: their names, units, and how their numbers are written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Metric:
    """A column of the table as a report tells it: its name, its unit (none: a number), and which way is better.

    `better` is 1 where more is better, -1 where less is, 0 where neither is. One that is `rare` is told only where
    some trial has more than none of it; one that is `bounded` is not defined for every trial.
    """

    column: str
    name: str
    unit: str = ""
    better: int = 0
    rare: bool = False
    bounded: bool = False

    @property
    def heading(self) -> str:
        """The name with the unit."""
        return f"{self.name} ({self.unit})" if self.unit else self.name


METRICS = (
    Metric("clean", "clean", "share", 1),
    Metric("counted_rounds", "counted rounds", better=1),
    Metric("rounds", "rounds", better=1),
    Metric("goals_visited", "goals visited", "share", 1),
    Metric("longest_gap_s", "longest gap between visits", "s", -1),
    Metric("breaches", "breaches of the ego", better=-1),
    Metric("breaches_of_others", "breaches of others"),
    Metric("assumption_broken", "assumption broken by others", "share"),
    Metric("collisions", "collisions", better=-1),
    Metric("collisions_ego_fault", "collisions, the ego's fault", better=-1),
    Metric("collisions_other_fault", "collisions, the other's fault"),
    Metric("collisions_both_fault", "collisions, the fault of both", better=-1),
    Metric("collisions_among_others", "collisions among others"),
    Metric("min_clearance_m", "least clearance", "m", 1),
    Metric("distance_m", "distance", "m"),
    Metric("standing_share", "standing", "share", -1),
    Metric("off_road_s", "off the road", "s", -1),
    Metric("off_road_share", "off the road", "share", -1),
    Metric("lane_departures", "lane departures", better=-1),
    Metric("interventions", "interventions of a shield", "ticks", -1, rare=True),
    Metric("duration_s", "duration", "s"),
    Metric("paper_score", "score of the paper", better=1),
    Metric("icra2016", "ICRA 2016, counts samples", better=1, bounded=True),
)
"""The metrics of the table, in the order of a report: what ranks controllers first, the score of 2016 last."""

WALL_METRICS = (
    Metric("time_to_begin_s", "time to begin, wall clock", "s", -1),
    Metric("act_mean_s", "time to act, mean, wall clock", "s", -1),
    Metric("act_p99_s", "time to act, 99 %, wall clock", "s", -1),
    Metric("act_max_s", "time to act, longest, wall clock", "s", -1),
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
