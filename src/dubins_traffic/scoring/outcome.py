"""The score of a trial from what a batch has counted: what `scoring.score.Scorer` finds in its frames."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from dubins_traffic.cars.state import EGO, NONE, Contact, Frames
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.record.header import bare_name
from dubins_traffic.record.sink import Ending
from dubins_traffic.scoring.collisions import Collision, Collisions
from dubins_traffic.scoring.driving import Driven
from dubins_traffic.scoring.goals import GoalVisits, Visits
from dubins_traffic.scoring.icra2016 import COLLISION_SCORE
from dubins_traffic.scoring.margins import Margins
from dubins_traffic.scoring.score import Score
from dubins_traffic.scoring.tally import (
    CLEARANCE,
    COLLIDED,
    DEPARTURES,
    DISTANCE,
    GAP,
    GOALS,
    INSIDE,
    LAST_VISIT,
    OFF_ROAD,
    OFF_TICKS,
    ROUNDS,
    SAMPLED,
    STANDING,
    VISITS,
    Tally,
)
from dubins_traffic.scoring.verdict import Verdict, reach_verdict
from dubins_traffic.spec.judge import Breach, Running, accused, order
from dubins_traffic.spec.parameters import RuleParameters

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance


def score_of(
    instance: Instance,
    b: int,
    tally: Tally,
    contacts: Sequence[Contact],
    breaches: Sequence[Breach],
    running: Running,
    ending: Ending,
    controller: str,
    time_to_begin: float | None,
) -> Score:
    """Return the score of trial b of a batch, which ended with `ending`.

    `contacts`, with `at_fault`, and the `breaches` of the docket are in order of time; `running` is what hung over the
    cars in the last frame.
    """
    ints: list[int] = tally.ints[b].tolist()
    floats: list[float] = tally.floats[b].tolist()
    rate, ticks = instance.problem.rate, ending.ticks
    visits = _visits(instance, b, tally, ticks)
    collisions, among_others = _collisions(instance, contacts)
    verdict = None
    if instance.problem.rules:
        verdict = _verdict(instance, b, tally, contacts, breaches, running, collisions, visits, ticks)
    return Score(
        trial=instance.trial,
        seed=instance.seed,
        end=ending.end.value,
        controller=bare_name(controller),
        record=None,
        duration_s=ticks / rate,
        icra2016=_icra2016(instance, ints, ticks + 1),
        collisions=collisions,
        collisions_among_others=among_others,
        rounds=visits.rounds,
        goals_visited=visits.visited,
        goals=visits.goals,
        driven=Driven(
            floats[DISTANCE],
            ints[STANDING] / max(1, ticks),
            ints[OFF_ROAD] / rate,
            ints[OFF_ROAD] / max(1, ticks),
            ints[DEPARTURES],
        ),
        min_clearance_m=None if math.isinf(floats[CLEARANCE]) else max(0.0, floats[CLEARANCE]),
        time_to_begin_s=time_to_begin,
        verdict=verdict,
        formulas=(),
    )


def _visits(instance: Instance, b: int, tally: Tally, ticks: int) -> Visits:
    goals = dict.fromkeys(instance.problem.goals)
    rows: list[list[int]] = _goal_rows(b, tally)
    rate = instance.problem.rate
    found = tuple(
        GoalVisits(goal, row[VISITS], max(row[GAP], ticks - row[LAST_VISIT]) / rate)
        for goal, row in zip(goals, rows, strict=True)
    )
    visited = sum(row[VISITS] > 0 for row in rows) / len(rows) if rows else 1.0
    return Visits(found, visited, int(tally.ints[b, ROUNDS]))


def _goal_rows(b: int, tally: Tally) -> list[list[int]]:
    first = tally.goal_off[b]
    return tally.goal[first : first + tally.ints[b, GOALS]].tolist()


def _collisions(instance: Instance, contacts: Sequence[Contact]) -> tuple[tuple[Collision, ...], int]:
    listed = Collisions()
    listed.begin(instance)
    listed.take(contacts)
    return listed.result(), listed.among_others


def _icra2016(instance: Instance, ints: Sequence[int], samples: int) -> float:
    if ints[COLLIDED]:
        return COLLISION_SCORE
    agents = sum(name.startswith("agent") for name in instance.names[EGO + 1 :])
    rows, columns = instance.problem.network.shape
    rounds = ints[SAMPLED] if ints[GOALS] else samples
    return agents * rows * columns * rounds / max(1.0, ints[OFF_TICKS] / instance.problem.rate)


def _verdict(
    instance: Instance,
    b: int,
    tally: Tally,
    contacts: Sequence[Contact],
    breaches: Sequence[Breach],
    running: Running,
    collisions: tuple[Collision, ...],
    visits: Visits,
    ticks: int,
) -> Verdict:
    def was_sensed(car: int, first: int, last: int) -> bool:
        return first <= tally.sensed[b, car] <= last

    return reach_verdict(
        instance,
        RuleParameters.from_mapping(instance.problem.rules),
        sorted([*breaches, *accused(contacts)], key=order),
        collisions,
        visits,
        [row[INSIDE] != 0 for row in _goal_rows(b, tally)],
        was_sensed,
        running,
        _margins(instance, b, tally, ticks),
    )


def _margins(instance: Instance, b: int, tally: Tally, ticks: int) -> dict[str, float | None]:
    """Return what `scoring.margins` finds in the ego's frames, and the smallest gap that has been counted."""
    poses: Floats = tally.pose[b, : ticks + 1, :, None]
    marks: Ints = tally.mark[b, : ticks + 1, :, None]
    nothing: Floats = np.zeros_like(poses[:, 0])
    none: Ints = np.full_like(marks[:, 0], NONE)
    x, y, c, s = (poses[:, k] for k in range(4))
    frames = Frames(
        first=0,
        rate=instance.problem.rate,
        x=x,
        y=y,
        c=c,
        s=s,
        speed=nothing,
        yaw_rate=nothing,
        command_speed=nothing,
        command_yaw_rate=nothing,
        segment=none,
        at=none,
        crosses=none,
        lane=marks[:, 1],
        bits=marks[:, 0].astype(np.uint32),
    )
    margins = Margins()
    margins.begin(instance)
    margins.frames(frames)
    gap = float(tally.floats[b, CLEARANCE])
    return {**margins.result(), "1.collision": None if math.isinf(gap) else max(0.0, gap)}
