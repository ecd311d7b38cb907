"""The score of a batched trial from its tally; it equals what `scoring.score.Scorer` finds in the frames."""

from __future__ import annotations

import math
from collections.abc import Sequence, Set
from typing import TYPE_CHECKING

import numpy as np

from dubins_traffic.cars.state import Contact
from dubins_traffic.cars.tables import CarTable
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.records import Rows, table
from dubins_traffic.record.sink import Ending
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.breach_log import EntryMargins
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.referee import Breach, Pending, accused, order
from dubins_traffic.scoring.clean import is_clean
from dubins_traffic.scoring.collisions import Collision, Collisions
from dubins_traffic.scoring.driving import Driven
from dubins_traffic.scoring.duration import early_rounds, planned_ticks, ran_whole
from dubins_traffic.scoring.goals import RECURRENT, GoalDiscs, GoalVisits, Visits, rounds_with_share
from dubins_traffic.scoring.icra2016 import COLLISION_SCORE, weight_of
from dubins_traffic.scoring.margins import entries_by_rule, margins_by_rule
from dubins_traffic.scoring.margins_kernel import EgoMargins, MarginRules, MarginTables, find_margins
from dubins_traffic.scoring.paper import paper_score
from dubins_traffic.scoring.score import Score
from dubins_traffic.scoring.tally_tables import GoalCounts, Tally, TrialCounts
from dubins_traffic.scoring.verdict import reach_verdict

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance


class BatchScores:
    """The tallies of some trials of a batch that have ended, from which their scores follow.

    Parameters
    ----------
    trials, frames : (K,)
        Numbers of the trials in the batch, and of frames that each has.
    tally, margins
        The tally of the batch, and the parameters of its margins (`scoring.margins_kernel`).
    roads, cars
        The roads and the cars of the batch.
    """

    def __init__(
        self,
        trials: Ints,
        frames: Ints,
        tally: Tally,
        margins: Rows[MarginRules],
        roads: RoadTable,
        cars: CarTable,
    ) -> None:
        self._found = table(EgoMargins, len(tally.trial))
        tables = MarginTables(margins, roads, cars, np.zeros(tally.ego.shape[1]))
        nets = np.ascontiguousarray(tally.trial["net"])
        find_margins(trials, frames, tally.ego, nets, tables, self._found)
        self._tally = tally

    def score(
        self,
        instance: Instance,
        b: int,
        contacts: Sequence[Contact],
        breaches: Sequence[Breach],
        seen: Set[tuple[int, int]],
        running: Pending,
        entry: EntryMargins,
        ending: Ending,
        rules: RuleParameters,
        controller: str,
        time_to_begin: float | None,
    ) -> Score:
        """Return the score of trial b, which ended with `ending`, whose ego was driven by `controller`.

        `contacts`, with `at_fault`, and `breaches`, those of the breach log, are in order of time. `seen` holds (car,
        tick) of each breach by an e-agent that was within the sensing radius then. `running` are the pending
        obligations after the last frame, `entry` the margins of rule 3.
        """
        own, margins = self._tally.trial[b], self._found[b]
        rate, ticks, whole = instance.problem.rate, ending.ticks, ran_whole(instance, ending, ending.ticks)
        goals = [self._tally.goal[g] for g in range(own.first_goal, own.last_goal)]
        visits = _visits(instance, goals, own.rounds)
        collisions, among_others = _collisions(instance, contacts) if contacts else ((), 0)
        gap = None if math.isinf(own.clearance) else max(0.0, own.clearance)
        verdict = None
        if instance.problem.rules:
            verdict = reach_verdict(
                instance,
                rules,
                sorted([*breaches, *accused(contacts)], key=order) if breaches or contacts else (),
                collisions,
                visits,
                [goal.visits > 0 and goal.last_visit == ticks for goal in goals],
                lambda car, first, last: bool(first <= self._tally.sensed[b, car] <= last),
                lambda car, tick: (car, tick) in seen,
                running,
                margins_by_rule(gap, (margins.road, margins.line, margins.back, margins.turn))
                | entries_by_rule(entry, instance.problem.period),
                whole=whole,
                by_controller=ending.by_controller,
            )
        clean = is_clean(verdict, collisions, whole=whole)
        early = rounds_with_share(own.early_rounds, own.early_goals, len(goals))
        driven = _driven(own, rate, ticks)
        return Score(
            trial=instance.trial,
            seed=instance.seed,
            end=ending.end.value,
            controller=controller,
            record=None,
            duration_s=ticks / rate,
            rounds=visits.rounds,
            counted_rounds=visits.rounds if clean else 0,
            rounds_before_breach=early_rounds(early, ending),
            goals_visited=visits.visited,
            goals=visits.goals,
            collisions=collisions,
            collisions_among_others=among_others,
            driven=driven,
            min_clearance_m=gap,
            time_to_begin_s=time_to_begin,
            verdict=verdict,
            formulas=(),
            paper_score=paper_score(instance, collisions, visits.rounds, driven.off_road_s),
            icra2016=_icra2016(instance, own, ticks + 1),
        )


def _driven(own: TrialCounts, rate: float, ticks: int) -> Driven:
    off_road, most = own.off_road, max(1, ticks)
    return Driven(own.distance, own.standing / most, off_road / rate, off_road / most, own.departures)


def _visits(instance: Instance, rows: Sequence[GoalCounts], rounds: int) -> Visits:
    goals = dict.fromkeys(instance.problem.goals)
    rate, planned = instance.problem.rate, planned_ticks(instance)
    found = [
        GoalVisits(goal, row.visits, max(row.gap, planned - row.last_visit) / rate)
        for goal, row in zip(goals, rows, strict=True)
    ]
    visited = sum([row.visits > 0 for row in rows]) / len(rows) if rows else 1.0
    fewest = min([row.visits for row in rows], default=RECURRENT)
    if fewest == RECURRENT:
        at_start = GoalDiscs(instance).at_start(instance)
        fewest = min(
            [row.visits - there for row, there in zip(rows, at_start, strict=True)], default=RECURRENT
        )
    return Visits(tuple(found), visited, rounds, fewest >= RECURRENT)


def _collisions(instance: Instance, contacts: Sequence[Contact]) -> tuple[tuple[Collision, ...], int]:
    listed = Collisions()
    listed.begin(instance)
    listed.take(contacts)
    return listed.result(), listed.among_others


def _icra2016(instance: Instance, own: TrialCounts, samples: int) -> float | None:
    weight = weight_of(instance)
    if weight is None:
        return None
    if own.collided:
        return COLLISION_SCORE
    rounds = own.sampled if own.last_goal > own.first_goal else samples
    return weight * rounds / max(1.0, own.off_ticks / instance.problem.rate)
