"""The metrics of a batch, counted tick by tick in one compiled pass: the numbers that the sinks find in frames."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from dubins_traffic.cars.near import Spacing, ticks_within
from dubins_traffic.cars.state import EGO, Labels, State
from dubins_traffic.cars.tables import CarTable, ObstacleTable, box_at, box_of
from dubins_traffic.kernels.arrays import Floats, Ints, distinct
from dubins_traffic.kernels.compile import jit, jit_inline
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.judged import kinds_of
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.propositions import LEFT, ON_ROAD
from dubins_traffic.scoring.box_gap import box_gap
from dubins_traffic.scoring.icra2016 import COLLISION_DISTANCE, ROAD_HALF_WIDTH
from dubins_traffic.scoring.icra2016 import counts as counts_in_2016

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

(
    NET, GOALS, STANDING, OFF_ROAD, DEPARTURES, COLLIDED, OFF_SINCE, OFF_TICKS, SAMPLED, ROUNDS, SEALED, AGAIN, LAST_AT,
) = range(13)  # fmt: skip
INTS = 13
"""Columns of `Tally.ints`.

NET: the trial's network. GOALS: how many goals it has. STANDING, OFF_ROAD, DEPARTURES: ticks and frames that
`scoring.driving` counts. COLLIDED, OFF_SINCE (-1: on the road), OFF_TICKS, SAMPLED: what `scoring.icra2016` counts, its
rounds last. ROUNDS: by visits. SEALED: 1 once the ego has broken a rule, from when on `Tally.sensed` stays as it is.
AGAIN: the next tick in which the ego may come to a goal, be in one, or leave the road of 2016. LAST_AT: the
intersection whose disc has held the ego since the last visit, the latest; -1: none.
"""

DISTANCE, CLEARANCE, STILL, RADIUS, SIGHT2 = range(5)
FLOATS = 5
"""Columns of `Tally.floats`: metres driven, smallest gap so far; how far a car that stands moves in a tick at most, the
goals' radius, the square of the sensing radius."""

VERTEX, SAMPLE_DONE, VISIT_DONE, INSIDE, VISITS, LAST_VISIT, GAP, FRESH = range(8)
GOAL_INTS = 8
"""Columns of `Tally.goal`: the goal's vertex, whether it is done in the present round of samples, and of visits,
whether the ego is inside its disc, visits, tick of the last one (0 before the first), longest gap between them, and
whether coming into its disc is a visit: there was none yet, or the ego has been in another disc since."""


ROUNDING = 1e-6
"""What rounding can't make up, metres."""
FARTHEST = 100.0
"""Metres beyond which it does not matter how far something is."""


class Tally(Tables):
    """What is counted of each trial.

    `ints` (B, INTS), `floats` (B, FLOATS); `goal_off` (B,) and `goal` (G, GOAL_INTS): the goals of trial b from row
    goal_off[b] on, each once; `counts` (B, N): 1 for the e-agents that count in the score of 2016; `sensed` (B, N): the
    last tick at which the car was within the ego's sensing radius, -1 before; `before` (B, N, 2): where the cars were
    in the frame before; `left` (B,): whether the ego was left there; `pose` (B, F, 4) and `mark` (B, F, 2): x, y,
    cosine and sine of the ego in each frame so far, its flags and lane state.
    """

    ints: Ints
    floats: Floats
    goal_off: Ints
    goal: Ints
    counts: Ints
    sensed: Ints
    before: Floats
    left: Ints
    pose: Floats
    mark: Ints


def new_tally(instances: Sequence[Instance], nets: Ints, cars: int) -> Tally:
    """Return the tally of a batch of instances, whose networks have the numbers `nets`, before the first frame."""
    trials = len(instances)
    ints = np.zeros((trials, INTS), dtype=np.int64)
    floats = np.zeros((trials, FLOATS))
    ints[:, [OFF_SINCE, LAST_AT]] = -1
    ints[:, NET] = nets
    floats[:, CLEARANCE] = np.inf
    counts = np.zeros((trials, cars), dtype=np.int64)
    kinds, index = kinds_of([instance.problem for instance in instances])
    rules = [RuleParameters.from_mapping(kind.rules) for kind in kinds]
    sizes = [
        (own.still_speed / kind.rate, kind.intersection_radius, kind.sensing_radius * kind.sensing_radius)
        for own, kind in zip(rules, kinds, strict=True)
    ]
    floats[:, [STILL, RADIUS, SIGHT2]] = np.array(sizes)[index]
    fleets, whose = distinct([id(instance.e_agents) for instance in instances])
    for number, b in enumerate(fleets):
        count: list[bool] = [counts_in_2016(agent.name) for agent in instances[b].e_agents]
        counts[whose == number, 1 : 1 + len(count)] = count
    goals = [tuple(dict.fromkeys(instance.problem.goal_vertices)) for instance in instances]
    ints[:, GOALS] = [len(own) for own in goals]
    last = ints[:, GOALS].cumsum()
    goal = np.zeros((last[-1], GOAL_INTS), dtype=np.int64)
    goal[:, VERTEX] = list(chain.from_iterable(goals))
    goal[:, FRESH] = 1
    sensed = np.full((trials, cars), -1, dtype=np.int64)
    frames = 1 + max(max(1, instance.ticks) for instance in instances)
    return Tally(
        ints,
        floats,
        last - ints[:, GOALS],
        goal,
        counts,
        sensed,
        np.zeros((trials, cars, 2)),
        np.zeros(trials, dtype=np.int64),
        np.empty((trials, frames, 4)),
        np.empty((trials, frames, 2), dtype=np.int64),
    )


@jit
def count_frame(
    b: int, tick: int, state: State, labels: Labels, roads: RoadTable, cars: CarTable, obstacles: ObstacleTable,
    spacing: Spacing, tally: Tally,
) -> None:  # fmt: skip
    """Count frame `tick` of trial b."""
    floats = tally.floats[b]
    ints = tally.ints[b]
    x, y = state.x[b, EGO], state.y[b, EGO]
    bits = np.int64(labels.bits[b, EGO])
    left = 1 if bits & LEFT != 0 else 0
    pose = tally.pose[b, tick]
    pose[0], pose[1], pose[2], pose[3] = x, y, state.c[b, EGO], state.s[b, EGO]
    tally.mark[b, tick, 0] = bits
    tally.mark[b, tick, 1] = labels.lane[b, EGO]
    if tick > 0:
        moved = _moved(b, EGO, state, tally)
        floats[DISTANCE] += moved
        ints[STANDING] += 0 if moved >= floats[STILL] else 1
        ints[OFF_ROAD] += 1 if bits & ON_ROAD == 0 else 0
        if left > tally.left[b] and _others_move(b, state, tally):
            ints[DEPARTURES] += 1
    tally.left[b] = left
    _look_at_cars(b, tick, state, cars, tally)
    if obstacles.off[b] != obstacles.off[b + 1]:
        _look_at_obstacles(b, state, cars, obstacles, floats)
    at = labels.at[b, EGO]
    if at >= 0 and at != ints[LAST_AT]:
        _freshen(b, at, tally)
    if tick >= ints[AGAIN]:
        spare = _count_goals(b, tick, x, y, roads, tally)
        spare = min(spare, _count_off_road(b, tick, x, y, labels.segment[b, EGO], roads, tally))
        ints[AGAIN] = tick + ticks_within(spare - ROUNDING, spacing, b)
    for n in range(state.count[b]):
        tally.before[b, n, 0] = state.x[b, n]
        tally.before[b, n, 1] = state.y[b, n]


@jit_inline
def _moved(b: int, n: int, state: State, tally: Tally) -> float:
    dx = state.x[b, n] - tally.before[b, n, 0]
    dy = state.y[b, n] - tally.before[b, n, 1]
    return sqrt(dx * dx + dy * dy)


@jit
def _others_move(b: int, state: State, tally: Tally) -> bool:
    moves = 0
    for n in range(1, state.count[b]):
        moves += 1 if _moved(b, n, state, tally) >= tally.floats[b, STILL] else 0
    return moves > 0


@jit_inline
def _look_at_cars(b: int, tick: int, state: State, cars: CarTable, tally: Tally) -> None:
    """Keep the smallest gap to the cars, who was sensed when, and whether anyone came too near by the rules of 2016."""
    floats = tally.floats[b]
    x, y = state.x[b, EGO], state.y[b, EGO]
    reach = floats[CLEARANCE] + 2.0 * cars.reach[b] + 1e-9
    near2 = max(reach * reach, 2.0 * COLLISION_DISTANCE * COLLISION_DISTANCE)
    sight2 = floats[SIGHT2] if tally.ints[b, SEALED] == 0 else -1.0
    sensed = tally.sensed[b]
    near = 0
    for n in range(1, state.count[b]):
        dx = state.x[b, n] - x
        dy = state.y[b, n] - y
        d2 = dx * dx + dy * dy
        if d2 <= sight2:
            sensed[n] = tick
        if d2 <= near2:
            near = 1
    if near != 0:
        _look_closer(b, near2, state, cars, tally)


@jit
def _look_closer(b: int, near2: float, state: State, cars: CarTable, tally: Tally) -> None:
    """Look at the cars whose squared distance from the ego is up to `near2`."""
    floats = tally.floats[b]
    for n in range(1, state.count[b]):
        dx = state.x[b, n] - state.x[b, EGO]
        dy = state.y[b, n] - state.y[b, EGO]
        d2 = dx * dx + dy * dy
        if d2 <= near2:
            if tally.counts[b, n] != 0 and sqrt(d2) < COLLISION_DISTANCE:
                tally.ints[b, COLLIDED] = 1
            if floats[CLEARANCE] > 0.0:
                gap = _car_gap(b, n, state, cars)
                floats[CLEARANCE] = min(floats[CLEARANCE], gap)


@jit
def _car_gap(b: int, n: int, state: State, cars: CarTable) -> float:
    apart = box_gap(box_at(b, EGO, state, cars), box_at(b, n, state, cars))
    return apart - 2.0 * cars.rounding[b]


@jit
def _look_at_obstacles(
    b: int, state: State, cars: CarTable, obstacles: ObstacleTable, floats: Floats
) -> None:
    """Keep the smallest gap to the obstacles."""
    x, y = state.x[b, EGO], state.y[b, EGO]
    for k in range(obstacles.off[b], obstacles.off[b + 1]):
        part = obstacles.parts[k]
        dx = part.x - x
        dy = part.y - y
        far = floats[CLEARANCE] + cars.reach[b] + part.reach + 1e-9
        if floats[CLEARANCE] > 0.0 and dx * dx + dy * dy <= far * far:
            apart = box_gap(box_at(b, EGO, state, cars), box_of(part))
            floats[CLEARANCE] = min(floats[CLEARANCE], apart - cars.rounding[b] - part.rounding)


@jit_inline
def _freshen(b: int, at: int, tally: Tally) -> None:
    """Note that the ego is in the disc of `at`: coming into that of any other goal will be a visit."""
    tally.ints[b, LAST_AT] = at
    for g in range(tally.goal_off[b], tally.goal_off[b] + tally.ints[b, GOALS]):
        if tally.goal[g, VERTEX] != at:
            tally.goal[g, FRESH] = 1


@jit_inline
def _count_goals(b: int, tick: int, x: float, y: float, roads: RoadTable, tally: Tally) -> float:
    """Count samples inside the goals' discs, visits, and rounds of both.

    Returns how far the ego is from all these discs, metres; 0 where it is in one.
    """
    ints = tally.ints[b]
    first = tally.goal_off[b]
    last = first + ints[GOALS]
    offset = roads.vert_off[ints[NET]]
    radius = tally.floats[b, RADIUS]
    some = False
    spare = FARTHEST
    for g in range(first, last):
        goal = tally.goal[g]
        dx = x - roads.vert[offset + goal[VERTEX], 0]
        dy = y - roads.vert[offset + goal[VERTEX], 1]
        away = sqrt(dx * dx + dy * dy)
        spare = min(spare, max(away - radius, 0.0))
        inside = 1 if away < radius else 0
        if inside > 0:
            some = True
            goal[SAMPLE_DONE] = 1
            if goal[INSIDE] == 0 and goal[FRESH] != 0:
                goal[FRESH] = 0
                ints[LAST_AT] = -1
                goal[VISIT_DONE] = 1
                goal[VISITS] += 1
                goal[GAP] = max(goal[GAP], tick - goal[LAST_VISIT])
                goal[LAST_VISIT] = tick
        goal[INSIDE] = inside
    if some:
        ints[SAMPLED] += _round(tally.goal, first, last, SAMPLE_DONE)
        ints[ROUNDS] += _round(tally.goal, first, last, VISIT_DONE)
    return spare


@jit_inline
def _round(goal: Ints, first: int, last: int, column: int) -> int:
    """Return 1 if all goals are done, which are then to do again, else 0."""
    done = 1
    for g in range(first, last):
        done &= goal[g, column]
    if done == 1:
        for g in range(first, last):
            goal[g, column] = 0
    return done


@jit_inline
def _count_off_road(
    b: int, tick: int, x: float, y: float, segment: int, roads: RoadTable, tally: Tally
) -> float:
    """Count ticks off the road of 2016; return how far the ego is from the edge of its nearest segment, metres.

    0 where it is not on that one.
    """
    ints = tally.ints[b]
    net: int = ints[NET]
    first = roads.seg_off[net]
    spare = _inside(first + segment, x, y, roads)
    on = spare >= 0.0
    if not on:
        for k in range(first, roads.seg_off[net + 1]):
            on = on or _inside(k, x, y, roads) >= 0.0
    if on == (ints[OFF_SINCE] >= 0):
        if on:
            ints[OFF_TICKS] += tick - ints[OFF_SINCE]
        ints[OFF_SINCE] = -1 if on else tick
    return max(spare, 0.0)


@jit_inline
def _inside(k: int, x: float, y: float, roads: RoadTable) -> float:
    """Return how far a point is from the edge of segment k of the road of 2016, less than 0 outside it."""
    rx = x - roads.seg[k, 0]
    ry = y - roads.seg[k, 1]
    along = rx * roads.seg[k, 2] + ry * roads.seg[k, 3]
    beside = rx * roads.seg[k, 3] - ry * roads.seg[k, 2]
    return min(along, roads.seg[k, 4] - along, ROAD_HALF_WIDTH - abs(beside))
