"""Whether a trial ran its whole planned duration, and which of its rounds count where controllers are ranked."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.sink import End, Ending
from dubins_traffic.scoring.metric import Column, ScoreColumn

if TYPE_CHECKING:
    from dubins_traffic.scoring.counts import RoundCount


def planned_ticks(instance: Instance) -> int:
    """Return the number of ticks of a trial that runs to its planned end, at least 1."""
    return max(1, instance.ticks)


def ran_whole(instance: Instance, ending: Ending | None, last: int) -> bool:
    """Tell whether a trial ran its whole planned duration.

    Parameters
    ----------
    instance : Instance
        The instance that was run.
    ending : Ending or None
        How the trial ended; None while it runs, and for a record that was cut off.
    last : int
        Number of the last frame that there is.
    """
    return ending is not None and ending.end is End.DURATION and min(ending.ticks, last) >= planned_ticks(instance)


def early_rounds(early: RoundCount, goals: int, ending: Ending | None) -> float:
    """Return the rounds before the first breach, with the share of the `goals` goals of the round begun.

    0 without goals, or if the controller ended the trial. Norm: docs/rules.md#before-breach.
    """
    by_controller = ending is not None and ending.by_controller
    return early.rounds + early.goals / goals if goals and not by_controller else 0.0


COLUMNS = (
    ScoreColumn(Column("duration_s", "duration", "s"), lambda score: score.duration_s),
    ScoreColumn(Column("counted_rounds", "counted rounds", "", 1, "int32"), lambda score: score.counted_rounds),
)
