"""What is counted of a trial, its rounds and its goals, and whether it ran its whole planned duration."""

from __future__ import annotations

import numpy as np

from dubins_traffic.kernels.records import record
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.sink import End, Ending
from dubins_traffic.scoring.metric import Column, ScoreColumn


@record
class TrialCounts:
    """The counts of a trial, and the parameters on which they depend."""

    net: int
    """The trial's road network."""
    first_goal: int
    """Its first row of `Tally.goal`."""
    last_goal: int
    """The row after its last."""
    standing: int
    """Ticks in which the ego stands (`scoring.driving`)."""
    off_road: int
    """Ticks that end off the road (`scoring.driving`)."""
    departures: int
    """Departures from the lane (`scoring.driving`)."""
    left: int
    """1 if the ego was left in the frame before."""
    collided: int
    """1 once it has collided by the rules of 2016 (`scoring.icra2016`)."""
    off_since: int = -1
    """The tick in which it left the road of 2016; -1: it is on it."""
    off_ticks: int
    """Ticks off the road of 2016, without those since `off_since`."""
    sealed: int
    """1 once the ego has broken a rule, from when on `Tally.sensed` and `Tally.early` stay as they are."""
    again: int
    """The next tick in which the ego may come to a goal, be in one, or leave the road of 2016."""
    last_at: int = -1
    """The intersection whose disc has held the ego since the last visit, the latest; -1: none."""
    distance: float
    """Metres driven."""
    clearance: float = np.inf
    """The smallest gap so far, metres."""
    still: float
    """How far a car that stands moves in a tick at most, metres."""
    radius: float
    """Of the goals' discs, metres."""
    sight2: float
    """Square of the sensing radius, metres squared."""


@record
class RoundCount:
    """A count of rounds of one kind, of a trial."""

    rounds: int
    """Rounds completed."""
    goals: int
    """Goals done in the round that has begun."""


@record
class GoalCounts:
    """The counts of a goal of a trial."""

    vertex: int
    """Its intersection."""
    inside: int
    """1 if the ego is inside its disc."""
    visits: int
    """Visits so far."""
    last_visit: int
    """Tick of the last one, 0 before the first."""
    gap: int
    """Longest gap between them, ticks."""
    at_start: int
    """1 if its first visit was in frame 0."""
    fresh: int = 1
    """1 if coming into its disc is a visit: there was none yet, or the ego has been in another disc since."""


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
