"""The tally of a batch: what is counted of each trial, its goals and its cars."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from dubins_traffic.cars.near import Spacing
from dubins_traffic.cars.state import Labels, State
from dubins_traffic.cars.tables import CarTable, ObstacleTable
from dubins_traffic.kernels.arrays import Floats, Ints, distinct
from dubins_traffic.kernels.records import Grid, Rows, record, table
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.judged import distinct_problems
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.scoring.icra2016 import counts as counts_in_2016
from dubins_traffic.scoring.margins_kernel import EgoFrame

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance


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
    sampled: int
    """Rounds counted at samples, as in 2016."""
    rounds: int
    """Rounds counted by visits."""
    early_rounds: int
    """Rounds of the visits after frame 0, up to the frame of the ego's first breach."""
    early_goals: int
    """Goals visited in the round that has begun since, likewise."""
    sealed: int
    """1 once the ego has broken a rule, from when on `Tally.sensed` and the two above stay as they are."""
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
class GoalCounts:
    """The counts of a goal of a trial."""

    vertex: int
    """Its intersection."""
    sample_done: int
    """1 if it is done in the present round of samples."""
    visit_done: int
    """1 if it is done in the present round of visits."""
    inside: int
    """1 if the ego is inside its disc."""
    visits: int
    """Visits so far."""
    last_visit: int
    """Tick of the last one, 0 before the first."""
    gap: int
    """Longest gap between them, ticks."""
    early_done: int
    """1 if it is among `TrialCounts.early_goals`."""
    fresh: int = 1
    """1 if coming into its disc is a visit: there was none yet, or the ego has been in another disc since."""


class Tally(Tables):
    """The counts of each trial, `trial` (B,), and of its goals, `goal` (G,), one trial's after another's, each once.

    `counts` (B, N): 1 for the e-agents that count in the score of 2016; `sensed` (B, N): the last tick at which the car
    was within the ego's sensing radius, -1 before; `before_x`, `before_y` (B, N): where the cars were in the frame
    before; `ego` (B, F): the ego in each frame so far.
    """

    trial: Rows[TrialCounts]
    goal: Rows[GoalCounts]
    counts: Ints
    sensed: Ints
    before_x: Floats
    before_y: Floats
    ego: Grid[EgoFrame]


def new_tally(instances: Sequence[Instance], nets: Ints, cars: int) -> Tally:
    """Return the tally of a batch of instances, whose networks have the numbers `nets`, before the first frame."""
    trials = len(instances)
    trial = table(TrialCounts, trials)
    trial["net"] = nets
    counts = np.zeros((trials, cars), dtype=np.int64)
    kinds, index = distinct_problems([instance.problem for instance in instances])
    rules = [RuleParameters.from_mapping(kind.rules) for kind in kinds]
    trial["still"] = np.array([own.still_speed / kind.rate for own, kind in zip(rules, kinds, strict=True)])[
        index
    ]
    trial["radius"] = np.array([kind.intersection_radius for kind in kinds])[index]
    trial["sight2"] = np.array([kind.sensing_radius * kind.sensing_radius for kind in kinds])[index]
    fleets, whose = distinct([id(instance.e_agents) for instance in instances])
    for number, b in enumerate(fleets):
        count: list[bool] = [counts_in_2016(agent.name) for agent in instances[b].e_agents]
        counts[whose == number, 1 : 1 + len(count)] = count
    goals = [tuple(dict.fromkeys(instance.problem.goal_vertices)) for instance in instances]
    last = np.array([len(own) for own in goals]).cumsum()
    trial["first_goal"][1:] = last[:-1]
    trial["last_goal"] = last
    goal = table(GoalCounts, int(last[-1]))
    goal["vertex"] = list(chain.from_iterable(goals))
    frames = 1 + max(max(1, instance.ticks) for instance in instances)
    return Tally(
        trial=trial,
        goal=goal,
        counts=counts,
        sensed=np.full((trials, cars), -1, dtype=np.int64),
        before_x=np.zeros((trials, cars)),
        before_y=np.zeros((trials, cars)),
        ego=table(EgoFrame, (trials, frames)),
    )


class Counted(Tables):
    """All tables that counting takes: the frame, roads, cars and obstacles, and the tally."""

    state: State
    labels: Labels
    roads: RoadTable
    cars: CarTable
    obstacles: ObstacleTable
    spacing: Spacing
    tally: Tally
