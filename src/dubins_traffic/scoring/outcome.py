"""The score of a trial from what a batch has counted: what `scoring.score.Scorer` finds in its frames."""

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
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.referee import Breach, Pending, accused, order
from dubins_traffic.scoring.collisions import Collision, Collisions
from dubins_traffic.scoring.driving import Driven
from dubins_traffic.scoring.duration import counted_rounds, planned_ticks, ran_whole
from dubins_traffic.scoring.goals import GoalVisits, Visits
from dubins_traffic.scoring.icra2016 import COLLISION_SCORE, weight_of
from dubins_traffic.scoring.margins import margins_by_rule
from dubins_traffic.scoring.margins_kernel import EgoMargins, MarginRules, MarginTables, find_margins
from dubins_traffic.scoring.paper import paper_score
from dubins_traffic.scoring.score import Score, is_clean
from dubins_traffic.scoring.tally import (
    CLEARANCE,
    COLLIDED,
    DEPARTURES,
    DISTANCE,
    GAP,
    GOALS,
    LAST_VISIT,
    NET,
    OFF_ROAD,
    OFF_TICKS,
    ROUNDS,
    SAMPLED,
    STANDING,
    VISITS,
    Tally,
)
from dubins_traffic.scoring.verdict import reach_verdict

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance


class BatchScores:
    """What a batch has counted of some trials that have ended.

    Parameters
    ----------
    trials, frames : (K,)
        Which trials of the batch, and how many frames each has.
    tally, margins
        What has been counted of the batch, and what its margins depend on (`scoring.margins_kernel`).
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
        found = table(EgoMargins, len(tally.ints))
        tables = MarginTables(margins, roads, cars, np.zeros(int(tally.pose.shape[1])))
        nets = np.ascontiguousarray(tally.ints[:, NET])
        find_margins(trials, frames, tally.pose, tally.mark, nets, tables, found)
        numbers: list[int] = trials.tolist()
        self._row = {b: k for k, b in enumerate(numbers)}
        margin = [found[b] for b in numbers]
        self._margins = [(own.road, own.line, own.back) for own in margin]
        self._ints: list[list[int]] = tally.ints[trials].tolist()
        self._floats: list[list[float]] = tally.floats[trials].tolist()
        self._first: list[int] = tally.goal_off[trials].tolist()
        self._tally = tally

    def score(
        self,
        instance: Instance,
        b: int,
        contacts: Sequence[Contact],
        breaches: Sequence[Breach],
        seen: Set[tuple[int, int]],
        running: Pending,
        ending: Ending,
        rules: RuleParameters,
        controller: str,
        time_to_begin: float | None,
    ) -> Score:
        """Return the score of trial b, which ended with `ending`, whose ego was driven by `controller`.

        `contacts`, with `at_fault`, and the `breaches` of the breach_log are in order of time; `seen` holds (car, tick)
        of each breach by an e-agent that was within the sensing radius then; `running` is what hung over the cars in
        the last frame.
        """
        k = self._row[b]
        ints, floats = self._ints[k], self._floats[k]
        rate, ticks = instance.problem.rate, ending.ticks
        goals: list[list[int]] = self._tally.goal[self._first[k] : self._first[k] + ints[GOALS]].tolist()
        visits = _visits(instance, goals, ints[ROUNDS])
        whole = ran_whole(instance, ending, ticks)
        collisions, among_others = _collisions(instance, contacts) if contacts else ((), 0)
        gap = None if math.isinf(floats[CLEARANCE]) else max(0.0, floats[CLEARANCE])
        verdict = None
        if instance.problem.rules:
            verdict = reach_verdict(
                instance,
                rules,
                sorted([*breaches, *accused(contacts)], key=order) if breaches or contacts else (),
                collisions,
                visits,
                [row[VISITS] > 0 and row[LAST_VISIT] == ticks for row in goals],
                lambda car, first, last: bool(first <= self._tally.sensed[b, car] <= last),
                lambda car, tick: (car, tick) in seen,
                running,
                margins_by_rule(gap, self._margins[k]),
                whole=whole,
            )
        clean = is_clean(verdict, collisions)
        off_road = ints[OFF_ROAD] / rate
        return Score(
            trial=instance.trial,
            seed=instance.seed,
            end=ending.end.value,
            controller=controller,
            record=None,
            duration_s=ticks / rate,
            rounds=visits.rounds,
            counted_rounds=counted_rounds(visits.rounds, clean=clean, whole=whole),
            goals_visited=visits.visited,
            goals=visits.goals,
            collisions=collisions,
            collisions_among_others=among_others,
            driven=Driven(
                floats[DISTANCE],
                ints[STANDING] / max(1, ticks),
                off_road,
                ints[OFF_ROAD] / max(1, ticks),
                ints[DEPARTURES],
            ),
            min_clearance_m=gap,
            time_to_begin_s=time_to_begin,
            verdict=verdict,
            formulas=(),
            paper_score=paper_score(instance, collisions, visits.rounds, off_road),
            icra2016=_icra2016(instance, ints, ticks + 1),
        )


def _visits(instance: Instance, rows: Sequence[Sequence[int]], rounds: int) -> Visits:
    goals = dict.fromkeys(instance.problem.goals)
    rate, planned = instance.problem.rate, planned_ticks(instance)
    found = [
        GoalVisits(goal, row[VISITS], max(row[GAP], planned - row[LAST_VISIT]) / rate)
        for goal, row in zip(goals, rows, strict=True)
    ]
    visited = sum([row[VISITS] > 0 for row in rows]) / len(rows) if rows else 1.0
    return Visits(tuple(found), visited, rounds)


def _collisions(instance: Instance, contacts: Sequence[Contact]) -> tuple[tuple[Collision, ...], int]:
    listed = Collisions()
    listed.begin(instance)
    listed.take(contacts)
    return listed.result(), listed.among_others


def _icra2016(instance: Instance, ints: Sequence[int], samples: int) -> float | None:
    weight = weight_of(instance)
    if weight is None:
        return None
    if ints[COLLIDED]:
        return COLLISION_SCORE
    rounds = ints[SAMPLED] if ints[GOALS] else samples
    return weight * rounds / max(1.0, ints[OFF_TICKS] / instance.problem.rate)
