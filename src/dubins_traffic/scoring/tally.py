"""The metrics of batched trials, counted tick by tick (compiled); they equal what the sinks find in frames."""

from __future__ import annotations

from math import sqrt

import numpy as np

from dubins_traffic.cars.near import ticks_within
from dubins_traffic.cars.state import EGO, State
from dubins_traffic.cars.tables import CarTable, ObstacleTable, box_at, box_of
from dubins_traffic.kernels.compile import jit, jit_inline, jit_look, jit_rare
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.scoring.box_gap import box_gap
from dubins_traffic.scoring.icra2016 import COLLISION_DISTANCE, ROAD_HALF_WIDTH
from dubins_traffic.scoring.tally_tables import Counted, Tally, TrialCounts

ROUNDING = 1e-6
"""A distance that rounding errors never reach, metres."""
FARTHEST = 100.0
"""Metres beyond which distances are not told apart."""


@jit
def count_frame(b: int, tick: int, counted: Counted) -> None:
    """Count frame `tick` of trial b."""
    state, labels, roads, cars = counted.state, counted.labels, counted.roads, counted.cars
    obstacles, spacing, tally = counted.obstacles, counted.spacing, counted.tally
    own = tally.trial[b]
    x, y = state.x[b, EGO], state.y[b, EGO]
    bits = np.int64(labels.bits[b, EGO])
    left = 1 if bits & FLAG.LEFT != 0 else 0
    ego = tally.ego[b, tick]
    ego.x, ego.y, ego.c, ego.s = x, y, state.c[b, EGO], state.s[b, EGO]
    ego.bits, ego.lane = int(bits), labels.lane[b, EGO]
    if tick > 0:
        moved = _moved(b, EGO, state, tally)
        own.distance += moved
        own.standing += 0 if moved >= own.still else 1
        own.off_road += 1 if bits & FLAG.ON_ROAD == 0 else 0
        if left > own.left and _others_move(b, state, tally):
            own.departures += 1
    own.left = left
    _look_at_cars(b, tick, state, cars, tally)
    if obstacles.off[b] != obstacles.off[b + 1]:
        _look_at_obstacles(b, state, cars, obstacles, own)
    at = labels.at[b, EGO]
    if at >= 0 and at != own.last_at:
        _freshen(b, at, tally)
    if not _is_far(tick, own):
        spare = _count_goals(b, tick, x, y, roads, tally)
        spare = min(spare, _count_off_road(b, tick, x, y, labels.segment[b, EGO], roads, tally))
        own.again = tick + ticks_within(spare - ROUNDING, spacing, b)
    for n in range(state.count[b]):
        tally.before_x[b, n] = state.x[b, n]
        tally.before_y[b, n] = state.y[b, n]


@jit_look
def _is_far(tick: int, own: TrialCounts) -> bool:
    """Tell whether the ego is certain not to have reached a goal's disc, or the edge of the road of 2016."""
    return tick < own.again


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
    own = tally.trial[b]
    x, y = state.x[b, EGO], state.y[b, EGO]
    reach = own.clearance + 2.0 * cars.reach[b] + 1e-9
    near2 = max(reach * reach, 2.0 * COLLISION_DISTANCE * COLLISION_DISTANCE)
    sight2 = own.sight2 if own.sealed == 0 else -1.0
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
    """Do so for the cars whose squared distance from the ego is up to `near2` (m2)."""
    own = tally.trial[b]
    for n in range(1, state.count[b]):
        dx = state.x[b, n] - state.x[b, EGO]
        dy = state.y[b, n] - state.y[b, EGO]
        d2 = dx * dx + dy * dy
        if d2 <= near2:
            if tally.counts[b, n] != 0 and sqrt(d2) < COLLISION_DISTANCE:
                own.collided = 1
            if own.clearance > 0.0:
                gap = _car_gap(b, n, state, cars)
                own.clearance = min(own.clearance, gap)


@jit
def _car_gap(b: int, n: int, state: State, cars: CarTable) -> float:
    apart = box_gap(box_at(b, EGO, state, cars), box_at(b, n, state, cars))
    return apart - 2.0 * cars.rounding[b]


@jit_rare
def _look_at_obstacles(
    b: int, state: State, cars: CarTable, obstacles: ObstacleTable, own: TrialCounts
) -> None:
    """Update the smallest gap to the obstacles."""
    x, y = state.x[b, EGO], state.y[b, EGO]
    for k in range(obstacles.off[b], obstacles.off[b + 1]):
        part = obstacles.parts[k]
        dx = part.x - x
        dy = part.y - y
        far = own.clearance + cars.reach[b] + part.reach + 1e-9
        if own.clearance > 0.0 and dx * dx + dy * dy <= far * far:
            apart = box_gap(box_at(b, EGO, state, cars), box_of(part))
            own.clearance = min(own.clearance, apart - cars.rounding[b] - part.rounding)


@jit_inline
def _freshen(b: int, at: int, tally: Tally) -> None:
    """Note that the ego is in the disc of `at`: coming into that of any other goal is then a visit."""
    own = tally.trial[b]
    own.last_at = at
    for g in range(own.first_goal, own.last_goal):
        if tally.goal[g].vertex != at:
            tally.goal[g].fresh = 1


@jit_inline
def _count_goals(b: int, tick: int, x: float, y: float, roads: RoadTable, tally: Tally) -> float:
    """Count samples inside the goals' discs, visits, and rounds of both.

    Returns how far the ego is from all these discs, metres; 0 where it is in one.
    """
    own = tally.trial[b]
    offset: int = roads.vert_off[own.net]
    radius = own.radius
    some = False
    spare = FARTHEST
    for g in range(own.first_goal, own.last_goal):
        goal = tally.goal[g]
        dx = x - roads.vertex[offset + goal.vertex].x
        dy = y - roads.vertex[offset + goal.vertex].y
        away = sqrt(dx * dx + dy * dy)
        spare = min(spare, max(away - radius, 0.0))
        inside = 1 if away < radius else 0
        if inside > 0:
            some = True
            goal.sample_done = 1
            if goal.inside == 0 and goal.fresh != 0:
                goal.fresh = 0
                own.last_at = -1
                goal.visit_done = 1
                goal.visits += 1
                goal.gap = max(goal.gap, tick - goal.last_visit)
                goal.last_visit = tick
                if tick > 0 and own.sealed == 0:
                    _count_early_visit(g, own, tally)
        goal.inside = inside
    if some:
        _count_rounds(own, tally)
    return spare


@jit_rare
def _count_early_visit(g: int, own: TrialCounts, tally: Tally) -> None:
    """Count a visit of goal `g` (row) for the rounds before the first breach (docs/rules.md#before-breach)."""
    own.early_goals += 1 - tally.goal[g].early_done
    tally.goal[g].early_done = 1
    if own.early_goals == own.last_goal - own.first_goal:
        own.early_rounds += 1
        own.early_goals = 0
        for k in range(own.first_goal, own.last_goal):
            tally.goal[k].early_done = 0


@jit_inline
def _count_rounds(own: TrialCounts, tally: Tally) -> None:
    """Count a round of samples, and one of visits, if all goals are done; all goals then become undone."""
    sampled, visited = 1, 1
    for g in range(own.first_goal, own.last_goal):
        sampled &= tally.goal[g].sample_done
        visited &= tally.goal[g].visit_done
    own.sampled += sampled
    own.rounds += visited
    if sampled + visited > 0:
        for g in range(own.first_goal, own.last_goal):
            goal = tally.goal[g]
            goal.sample_done = 0 if sampled == 1 else goal.sample_done
            goal.visit_done = 0 if visited == 1 else goal.visit_done


@jit_inline
def _count_off_road(
    b: int, tick: int, x: float, y: float, segment: int, roads: RoadTable, tally: Tally
) -> float:
    """Count ticks off the road of 2016; return how far the ego is from the edge of its nearest segment, metres.

    0 where it is not on that one.
    """
    own = tally.trial[b]
    first = roads.seg_off[own.net]
    spare = _inside(first + segment, x, y, roads)
    on = spare >= 0.0
    if not on:
        for k in range(first, roads.seg_off[own.net + 1]):
            on = on or _inside(k, x, y, roads) >= 0.0
    if on == (own.off_since >= 0):
        if on:
            own.off_ticks += tick - own.off_since
        own.off_since = -1 if on else tick
    return max(spare, 0.0)


@jit_inline
def _inside(k: int, x: float, y: float, roads: RoadTable) -> float:
    """Return how far a point is from the edge of segment k of the road of 2016, less than 0 outside it."""
    rx = x - roads.segment[k].x
    ry = y - roads.segment[k].y
    along = rx * roads.segment[k].tx + ry * roads.segment[k].ty
    beside = rx * roads.segment[k].ty - ry * roads.segment[k].tx
    return min(along, roads.segment[k].length - along, ROAD_HALF_WIDTH - abs(beside))
