"""The counts of a trial: one kernel counts a frame, in batches tick by tick, of a single trial block by block.

Live, in a batch and from a record the counts are these; `scoring.findings` turns them into a score.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from dubins_traffic.cars.near import Spacing, ticks_within
from dubins_traffic.cars.sensing import within_sight
from dubins_traffic.cars.state import EGO, Labels, State
from dubins_traffic.cars.tables import CarTable, ObstacleTable, box_at, box_of
from dubins_traffic.kernels.arrays import Floats, Ints, distinct
from dubins_traffic.kernels.boxes import box_gap
from dubins_traffic.kernels.compile import jit, jit_inline, jit_look, jit_rare
from dubins_traffic.kernels.records import Grid, Rows, table
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.roads.lookup import nearest_vertex
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.judged import distinct_problems
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.rules.visits import begins_visit, come_by, do_goal, finish_round
from dubins_traffic.scoring.counts import GoalCounts, RoundCount, TrialCounts
from dubins_traffic.scoring.icra2016 import COLLISION_DISTANCE, ROAD_HALF_WIDTH
from dubins_traffic.scoring.icra2016 import counts as counts_in_2016
from dubins_traffic.scoring.margins import EgoFrame, EgoMargins, MarginRules, MarginTables, find_margins

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

ROUNDING = 1e-6
"""A distance that rounding errors never reach, metres."""
FARTHEST = 100.0
"""Metres beyond which distances are not told apart."""


class Tally(Tables):
    """The counts of each trial, `trial` (B,), and of its goals, `goal` (G,), one trial's after another's, each once.

    Rounds are counted in three ways, (B,), with a 1 for the goals done in the present one, (G,): `samples`, in which
    a goal is done in each frame inside its disc, as in 2016 (`scoring.icra2016`); `rounds`, in which it is done by a
    visit; `early`, rounds of the visits after frame 0 and up to the frame of the ego's first breach.
    `counts` (B, N): 1 for the e-agents that count in the score of 2016; `sensed` (B, N): the last tick at which the car
    was within the ego's sensing radius, -1 before; `before_x`, `before_y` (B, N): where the cars were in the frame
    before; `ego` (B, F): the ego in each frame so far.
    """

    trial: Rows[TrialCounts]
    goal: Rows[GoalCounts]
    samples: Rows[RoundCount]
    sample_done: Ints
    rounds: Rows[RoundCount]
    round_done: Ints
    early: Rows[RoundCount]
    early_done: Ints
    counts: Ints
    sensed: Ints
    before_x: Floats
    before_y: Floats
    ego: Grid[EgoFrame]


class Counted(Tables):
    """All tables that counting takes: the frame, roads, cars and obstacles, and the tally."""

    state: State
    labels: Labels
    roads: RoadTable
    cars: CarTable
    obstacles: ObstacleTable
    spacing: Spacing
    tally: Tally


def new_tally(instances: Sequence[Instance], nets: Ints, cars: int) -> Tally:
    """Return the tally of a batch of instances, whose networks have the numbers `nets`, before the first frame."""
    trials = len(instances)
    trial = table(TrialCounts, trials)
    trial["net"] = nets
    counts = np.zeros((trials, cars), dtype=np.int64)
    kinds, index = distinct_problems([instance.problem for instance in instances])
    rules = [RuleParameters.from_mapping(kind.rules) for kind in kinds]
    trial["still"] = np.array([rule.still_speed / kind.rate for rule, kind in zip(rules, kinds, strict=True)])[index]
    trial["radius"] = np.array([kind.intersection_radius for kind in kinds])[index]
    trial["sight2"] = np.array([kind.sensing_radius * kind.sensing_radius for kind in kinds])[index]
    fleets, whose = distinct([id(instance.e_agents) for instance in instances])
    for number, b in enumerate(fleets):
        count: list[bool] = [counts_in_2016(agent.name) for agent in instances[b].e_agents]
        counts[whose == number, 1 : 1 + len(count)] = count
    goals = [tuple(dict.fromkeys(instance.problem.goal_vertices)) for instance in instances]
    last = np.array([len(goal) for goal in goals]).cumsum()
    trial["first_goal"][1:] = last[:-1]
    trial["last_goal"] = last
    goal = table(GoalCounts, int(last[-1]))
    goal["vertex"] = list(chain.from_iterable(goals))
    frames = 1 + max(max(1, instance.ticks) for instance in instances)
    return Tally(
        trial=trial,
        goal=goal,
        samples=table(RoundCount, trials),
        sample_done=np.zeros(len(goal), dtype=np.int64),
        rounds=table(RoundCount, trials),
        round_done=np.zeros(len(goal), dtype=np.int64),
        early=table(RoundCount, trials),
        early_done=np.zeros(len(goal), dtype=np.int64),
        counts=counts,
        sensed=np.full((trials, cars), -1, dtype=np.int64),
        before_x=np.zeros((trials, cars)),
        before_y=np.zeros((trials, cars)),
        ego=table(EgoFrame, (trials, frames)),
    )


def tally_margins(
    trials: Ints, frames: Ints, tally: Tally, rules: Rows[MarginRules], roads: RoadTable, cars: CarTable
) -> Rows[EgoMargins]:
    """Return the margins of some trials of a tally, (B,), of which each has so many frames; others' are infinite."""
    margins = table(EgoMargins, len(tally.trial))
    tables = MarginTables(rules, roads, cars, np.zeros(tally.ego.shape[1]))
    find_margins(trials, frames, tally.ego, np.ascontiguousarray(tally.trial["net"]), tables, margins)
    return margins


@jit
def count_frame(b: int, tick: int, counted: Counted) -> None:
    """Count frame `tick` of trial b."""
    state, labels, roads, cars = counted.state, counted.labels, counted.roads, counted.cars
    obstacles, spacing, tally = counted.obstacles, counted.spacing, counted.tally
    trial = tally.trial[b]
    x, y = state.x[b, EGO], state.y[b, EGO]
    bits = np.int64(labels.bits[b, EGO])
    left = 1 if bits & FLAG.LEFT != 0 else 0
    ego = tally.ego[b, tick]
    ego.x, ego.y, ego.c, ego.s = x, y, state.c[b, EGO], state.s[b, EGO]
    ego.bits, ego.lane = int(bits), labels.lane[b, EGO]
    if tick > 0:
        moved = _moved(b, EGO, state, tally)
        trial.distance += moved
        trial.standing += 0 if moved >= trial.still else 1
        trial.off_road += 1 if bits & FLAG.ON_ROAD == 0 else 0
        if left > trial.left and _others_move(b, state, tally):
            trial.departures += 1
    trial.left = left
    _look_at_cars(b, tick, state, cars, tally)
    if obstacles.off[b] != obstacles.off[b + 1]:
        _look_at_obstacles(b, state, cars, obstacles, trial)
    at = labels.at[b, EGO]
    if at >= 0 and at != trial.last_at:
        trial.last_at = at
        for g in range(trial.first_goal, trial.last_goal):
            come_by(at, tally.goal[g])
    if not _is_far(tick, trial):
        spare = _count_goals(b, tick, x, y, roads, tally)
        spare = min(spare, _count_off_road(b, tick, x, y, labels.segment[b, EGO], roads, tally))
        trial.again = tick + ticks_within(spare - ROUNDING, spacing, b)
    for n in range(state.count[b]):
        tally.before_x[b, n] = state.x[b, n]
        tally.before_y[b, n] = state.y[b, n]


@jit_look
def _is_far(tick: int, counts: TrialCounts) -> bool:
    """Tell whether the ego is certain not to have reached a goal's disc, or the edge of the road of 2016."""
    return tick < counts.again


@jit_inline
def _moved(b: int, n: int, state: State, tally: Tally) -> float:
    dx = state.x[b, n] - tally.before_x[b, n]
    dy = state.y[b, n] - tally.before_y[b, n]
    return sqrt(dx * dx + dy * dy)


@jit_rare
def _others_move(b: int, state: State, tally: Tally) -> bool:
    moves = 0
    for n in range(1, state.count[b]):
        moves += 1 if _moved(b, n, state, tally) >= tally.trial[b].still else 0
    return moves > 0


@jit_inline
def _look_at_cars(b: int, tick: int, state: State, cars: CarTable, tally: Tally) -> None:
    """Update the smallest gap to the cars, when each was sensed, and whether one came too near by the rules of 2016."""
    trial = tally.trial[b]
    x, y = state.x[b, EGO], state.y[b, EGO]
    reach = trial.clearance + 2.0 * cars.reach[b] + 1e-9
    near2 = max(reach * reach, 2.0 * COLLISION_DISTANCE * COLLISION_DISTANCE)
    sensed = tally.sensed[b]
    near = 0
    for n in range(1, state.count[b]):
        dx = state.x[b, n] - x
        dy = state.y[b, n] - y
        d2 = dx * dx + dy * dy
        if trial.sealed == 0 and within_sight(dx, dy, trial.sight2):
            sensed[n] = tick
        if d2 <= near2:
            near = 1
    if near != 0:
        _look_closer(b, near2, state, cars, tally)


@jit
def _look_closer(b: int, near2: float, state: State, cars: CarTable, tally: Tally) -> None:
    """Do so for the cars whose squared distance from the ego is up to `near2` (m2)."""
    trial = tally.trial[b]
    for n in range(1, state.count[b]):
        dx = state.x[b, n] - state.x[b, EGO]
        dy = state.y[b, n] - state.y[b, EGO]
        d2 = dx * dx + dy * dy
        if d2 <= near2:
            if tally.counts[b, n] != 0 and sqrt(d2) < COLLISION_DISTANCE:
                trial.collided = 1
            if trial.clearance > 0.0:
                gap = _car_gap(b, n, state, cars)
                trial.clearance = min(trial.clearance, gap)


@jit
def _car_gap(b: int, n: int, state: State, cars: CarTable) -> float:
    apart = box_gap(box_at(b, EGO, state, cars), box_at(b, n, state, cars))
    return apart - 2.0 * cars.rounding[b]


@jit_rare
def _look_at_obstacles(b: int, state: State, cars: CarTable, obstacles: ObstacleTable, counts: TrialCounts) -> None:
    """Update the smallest gap to the obstacles."""
    x, y = state.x[b, EGO], state.y[b, EGO]
    for k in range(obstacles.off[b], obstacles.off[b + 1]):
        part = obstacles.parts[k]
        dx = part.x - x
        dy = part.y - y
        far = counts.clearance + cars.reach[b] + part.reach + 1e-9
        if counts.clearance > 0.0 and dx * dx + dy * dy <= far * far:
            apart = box_gap(box_at(b, EGO, state, cars), box_of(part))
            counts.clearance = min(counts.clearance, apart - cars.rounding[b] - part.rounding)


@jit_inline
def _count_goals(b: int, tick: int, x: float, y: float, roads: RoadTable, tally: Tally) -> float:
    """Count samples inside the goals' discs, visits, and rounds of both.

    Returns how far the ego is from all these discs, metres; 0 where it is in one.
    """
    trial = tally.trial[b]
    offset: int = roads.vert_off[trial.net]
    radius = trial.radius
    some = False
    spare = FARTHEST
    for g in range(trial.first_goal, trial.last_goal):
        goal = tally.goal[g]
        dx = x - roads.vertex[offset + goal.vertex].x
        dy = y - roads.vertex[offset + goal.vertex].y
        away = sqrt(dx * dx + dy * dy)
        spare = min(spare, max(away - radius, 0.0))
        if away < radius:
            some = True
            do_goal(g, tally.sample_done, tally.samples[b])
        if begins_visit(away < radius, goal):
            _count_visit(b, g, tick, tally)
    if some:
        finish_round(trial.first_goal, trial.last_goal, tally.sample_done, tally.samples[b])
        finish_round(trial.first_goal, trial.last_goal, tally.round_done, tally.rounds[b])
        finish_round(trial.first_goal, trial.last_goal, tally.early_done, tally.early[b])
    return spare


@jit_rare
def _count_visit(b: int, g: int, tick: int, tally: Tally) -> None:
    """Count a visit of goal `g` (row)."""
    goal = tally.goal[g]
    tally.trial[b].last_at = -1
    goal.visits += 1
    goal.at_start = 1 if tick == 0 else goal.at_start
    goal.gap = max(goal.gap, tick - goal.last_visit)
    goal.last_visit = tick
    do_goal(g, tally.round_done, tally.rounds[b])
    if tick > 0 and tally.trial[b].sealed == 0:
        do_goal(g, tally.early_done, tally.early[b])


@jit_inline
def _count_off_road(b: int, tick: int, x: float, y: float, segment: int, roads: RoadTable, tally: Tally) -> float:
    """Count ticks off the road of 2016; return how far the ego is from the edge of its nearest segment, metres.

    0 where it is not on that one.
    """
    trial = tally.trial[b]
    first = roads.seg_off[trial.net]
    spare = _inside(first + segment, x, y, roads)
    on = spare >= 0.0
    if not on:
        for k in range(first, roads.seg_off[trial.net + 1]):
            on = on or _inside(k, x, y, roads) >= 0.0
    if on == (trial.off_since >= 0):
        if on:
            trial.off_ticks += tick - trial.off_since
        trial.off_since = -1 if on else tick
    return max(spare, 0.0)


@jit_inline
def _inside(k: int, x: float, y: float, roads: RoadTable) -> float:
    """Return how far a point is from the edge of segment k of the road of 2016, less than 0 outside it."""
    rx = x - roads.segment[k].x
    ry = y - roads.segment[k].y
    along = rx * roads.segment[k].tx + ry * roads.segment[k].ty
    beside = rx * roads.segment[k].ty - ry * roads.segment[k].tx
    return min(along, roads.segment[k].length - along, ROAD_HALF_WIDTH - abs(beside))


@jit
def count_frames(
    first: int, seal: int, poses: State, labels: Labels, begun: Ints, seen: Ints, counted: Counted
) -> None:
    """Count frames of the only trial; row f of `poses` and `labels` (F, N) is frame `first` (tick) + f.

    Visits are counted by poses, as all that is judged; flags, lane states and nearest segments are those of `labels`.
    The trial is sealed after frame `seal` (tick). `begun` (F, G) gets 1 for each goal of which a visit begins,
    `seen` (F, N) for each car that the ego senses.
    """
    state, ego, trial = counted.state, counted.labels, counted.tally.trial[0]
    segments = counted.roads.seg_off[1]
    for f in range(poses.x.shape[0]):
        for n in range(poses.x.shape[1]):
            state.x[0, n] = poses.x[f, n]
            state.y[0, n] = poses.y[f, n]
            state.c[0, n] = poses.c[f, n]
            state.s[0, n] = poses.s[f, n]
            dx, dy = poses.x[f, n] - poses.x[f, EGO], poses.y[f, n] - poses.y[f, EGO]
            seen[f, n] = 1 if within_sight(dx, dy, trial.sight2) else 0
        ego.segment[0, EGO] = min(max(labels.segment[f, EGO], 0), segments - 1)  # a record may name others
        v, away2 = nearest_vertex(counted.roads, 0, poses.x[f, EGO], poses.y[f, EGO])
        ego.at[0, EGO] = v if away2 < trial.radius * trial.radius else -1
        ego.lane[0, EGO] = labels.lane[f, EGO]
        ego.bits[0, EGO] = labels.bits[f, EGO]
        if first + f > seal:
            trial.sealed = 1
        count_frame(0, first + f, counted)
        for g in range(begun.shape[1]):
            goal = counted.tally.goal[g]
            begun[f, g] = 1 if goal.visits != 0 and goal.last_visit == first + f else 0
