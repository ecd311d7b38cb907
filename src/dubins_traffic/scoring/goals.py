"""The metrics of goals: visits, gaps between them, and completed rounds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dubins_traffic.problem.instance import Instance
from dubins_traffic.scoring.counts import planned_ticks
from dubins_traffic.scoring.metric import Column, ScoreColumn

if TYPE_CHECKING:
    from dubins_traffic.scoring.counts import GoalCounts

RECURRENT = 2
"""Visits of each goal after frame 0 that `satisfied` asks for (docs/rules.md#satisfied)."""


@dataclass(frozen=True, slots=True)
class GoalVisits:
    """Visits of one goal; `longest_gap_s` is the longest time without one, from frame 0 to the planned end."""

    goal: tuple[float, float]
    visits: int
    longest_gap_s: float


@dataclass(frozen=True, slots=True)
class Visits:
    """Visits of all goals, each goal once.

    `visited` is the share of them visited, 1 without goals; `recurrent` tells whether each was visited in at least
    `RECURRENT` frames after frame 0.
    """

    goals: tuple[GoalVisits, ...]
    visited: float
    rounds: int
    recurrent: bool


def visits_of(instance: Instance, rows: Sequence[GoalCounts], rounds: int, last: int) -> Visits:
    """Return the visits up to frame `last` from the counts of the goals; gaps run to the planned end at least."""
    rate, end = instance.problem.rate, max(planned_ticks(instance), last)
    goals = dict.fromkeys(instance.problem.goals)
    visits = [
        GoalVisits(goal, row.visits, max(row.gap, end - row.last_visit) / rate)
        for goal, row in zip(goals, rows, strict=True)
    ]
    visited = sum([row.visits > 0 for row in rows]) / len(rows) if rows else 1.0
    fewest = min([row.visits - row.at_start for row in rows], default=RECURRENT)
    return Visits(tuple(visits), visited, rounds, fewest >= RECURRENT)


COLUMNS = (
    ScoreColumn(Column("rounds", "rounds", "", 1, "int32"), lambda score: score.rounds),
    ScoreColumn(
        Column("rounds_before_breach", "rounds before the first breach", "", 1),
        lambda score: score.rounds_before_breach,
    ),
    ScoreColumn(Column("goals_visited", "goals visited", "share", 1), lambda score: score.goals_visited),
    ScoreColumn(
        Column("longest_gap_s", "longest gap between visits", "s", -1),
        lambda score: max((goal.longest_gap_s for goal in score.goals), default=None),
    ),
)
