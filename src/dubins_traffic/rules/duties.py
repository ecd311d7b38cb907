"""What e-agents owe (docs/rules.md#E3 to docs/rules.md#E6), judged in one frame (compiled)."""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from dubins_traffic.cars.near import Spacing, list_near, ticks_within
from dubins_traffic.cars.state import EGO, Labels, State
from dubins_traffic.kernels.compile import jit, jit_inline, jit_inner
from dubins_traffic.roads.lookup import lane_end
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.blocking import obstacle_narrows
from dubins_traffic.rules.breach_log import (
    CAME_BY,
    CROSSES,
    ENTER_TICKS,
    EXIT,
    EXIT_COUNTS,
    EXIT_PAUSED,
    EXIT_SINCE,
    EXIT_TICKS,
    FIRST_SINCE,
    GOAL,
    GOAL_GAP,
    GOAL_TICKS,
    IN_SINCE,
    LONE,
    NEVER_DUE,
    REST,
    REST_SINCE,
    REST_TICKS,
    SHARED_TICKS,
    WAY,
    BreachLog,
    RefereeParameters,
)
from dubins_traffic.rules.breaches import GOES, add, at_goal, judge_queue, run, when_due
from dubins_traffic.rules.exits import ego_at_exit, find_exit, look_for_exit, way_back
from dubins_traffic.rules.obstacles import ObstacleLanes
from dubins_traffic.rules.propositions import BLOCKED, EXCUSED, LINGERS, STANDS, STOPPED
from dubins_traffic.rules.tables import (
    CROSSING_DEGREE,
    FREE_NEEDED,
    GRAIN,
    LANE_WIDTH,
    NET,
    PROGRESS,
    RADIUS,
    Memory,
    RuleTable,
)

WAITS = STANDS | LINGERS | EXCUSED | STOPPED
"""Flags of a car that is no reason to expect the one behind it to go on."""


@jit_inline
def judge_agent(
    b: int,
    n: int,
    tick: int,
    bits: Any,
    lane: int,
    v: int,
    spacing: Spacing,
    state: State,
    roads: RoadTable,
    obstacles: ObstacleLanes,
    rules: RuleTable,
    terms: RefereeParameters,
    labels: Labels,
    memory: Memory,
    breach_log: BreachLog,
) -> int:
    """E3 to E5, of an e-agent in lane `lane` whose body meets the disc of v, or none (-1).

    Returns the next tick in which more may be due, if its labels stay as they are.
    """
    whole, row, filled, clock = terms.whole[b], breach_log.row, breach_log.filled, breach_log.clock[b, n]
    if bits & STOPPED != 0:
        ahead = lane_end(roads, rules.whole[b, NET], lane)
        judge_queue(b, n, tick, bits, lane, ahead, whole, memory.mark[b, n], clock, row, filled)
    else:
        clock[FIRST_SINCE] = -1
    if breach_log.past[b, n, CROSSES] != v or v < 0:
        clock[EXIT_SINCE] = -1
        clock[EXIT_COUNTS] = -1
    due = when_due(tick, clock, FIRST_SINCE, whole[ENTER_TICKS])
    if v >= 0:
        again = _judge_exit(
            b, n, tick, lane, v, spacing, state, roads, obstacles, rules, terms, labels, breach_log
        )  # fmt: skip
        due = min(due, again)
    free = bits & LINGERS != 0
    if free:
        due = tick + 1
        free = has_way(b, n, tick, spacing, state, roads, obstacles, rules, terms, labels, memory, breach_log)
    if run(free, tick, clock, REST_SINCE) == whole[REST_TICKS]:
        add(b, REST, n, tick, clock[REST_SINCE], -1, lane, row, filled)
    return due


@jit_inline
def _judge_exit(
    b: int,
    n: int,
    tick: int,
    lane: int,
    v: int,
    spacing: Spacing,
    state: State,
    roads: RoadTable,
    obstacles: ObstacleLanes,
    rules: RuleTable,
    terms: RefereeParameters,
    labels: Labels,
    breach_log: BreachLog,
) -> int:
    """E4, of an e-agent whose body meets the disc of v; return when to ask again, if its labels stay as they are.

    The ticks do not count in which the ego is there that came after it, or, for a while, with it.
    """
    clock, ego, ago = breach_log.clock[b, n], breach_log.clock[b, EGO], terms.whole[b, EXIT_TICKS]
    back = way_back(b, v, clock[CAME_BY], roads, rules)
    free, again = look_for_exit(
        b, n, tick, v, back, spacing, state, roads, obstacles, rules, terms, labels, breach_log
    )
    paused = False
    if labels.crosses[b, EGO] == v:
        shares = ego[IN_SINCE] == clock[IN_SINCE]
        lately = tick - clock[IN_SINCE] <= terms.whole[b, SHARED_TICKS]
        paused = ego[IN_SINCE] > clock[IN_SINCE] or (shares and lately)
    long = run(free, tick, clock, EXIT_SINCE)
    if long <= 0:
        clock[EXIT_PAUSED] = 0
    elif paused:
        clock[EXIT_PAUSED] += 1
    if long >= 0 and long - clock[EXIT_PAUSED] == ago and (long == 0 or not paused):
        add(b, EXIT, n, tick, clock[EXIT_SINCE], v, lane, breach_log.row, breach_log.filled)
    clock[EXIT_COUNTS] = -1 if paused else clock[EXIT_SINCE]
    if paused:
        return tick + 1
    return min(again, when_due(tick, clock, EXIT_SINCE, ago + clock[EXIT_PAUSED]))


@jit_inner
def has_way(
    b: int,
    n: int,
    tick: int,
    spacing: Spacing,
    state: State,
    roads: RoadTable,
    obstacles: ObstacleLanes,
    rules: RuleTable,
    terms: RefereeParameters,
    labels: Labels,
    memory: Memory,
    breach_log: BreachLog,
) -> bool:
    """E5: tell whether car n is in a lane with a free way ahead."""
    lane = labels.lane[b, n]
    bits = np.int64(labels.bits[b, n])
    if lane < 0 or bits & BLOCKED != 0 or (bits & STOPPED != 0 and bits & GOES != GOES):
        return False
    net: int = rules.whole[b, NET]
    own = memory.measure[b, n, PROGRESS]
    reach = terms.real[b, WAY]
    for k in range(state.count[b]):
        if labels.lane[b, k] == lane and np.int64(labels.bits[b, k]) & WAITS != 0:
            ahead = memory.measure[b, k, PROGRESS] - own
            if 0.0 < ahead <= reach:
                return False
    length = roads.seg[roads.seg_off[net] + lane // 2, 4]
    real = rules.real[b]
    needed = real[FREE_NEEDED] + GRAIN
    if obstacle_narrows(obstacles, b, lane, length, own, own + reach, real[LANE_WIDTH], needed):
        return False
    v = lane_end(roads, net, lane)
    row = roads.vert_off[net] + v
    if roads.degree[row] >= rules.whole[b, CROSSING_DEGREE] or length - real[RADIUS] - own > reach:
        return True
    for k in range(state.count[b]):
        if k != n and labels.crosses[b, k] == v and (k == EGO or breach_log.clock[b, k, CAME_BY] == lane):
            return False
    vx, vy = float(roads.vert[row, 0]), float(roads.vert[row, 1])
    count = list_near(state, b, tick, vx, vy, terms.real[b, LONE], spacing)
    back = way_back(b, v, lane, roads, rules)
    return find_exit(
        b, n, v, back, spacing.near, count, state, roads, obstacles, rules, terms, labels, breach_log
    )


@jit
def find_ways(
    tick: int,
    spacing: Spacing,
    state: State,
    roads: RoadTable,
    obstacles: ObstacleLanes,
    rules: RuleTable,
    terms: RefereeParameters,
    labels: Labels,
    memory: Memory,
    breach_log: BreachLog,
    found: Any,
) -> None:
    """Write down which cars of a frame that has been judged are in a lane with a free way ahead, (B, N)."""
    for b in range(state.count.shape[0]):
        for n in range(state.count[b]):
            found[b, n] = has_way(
                b, n, tick, spacing, state, roads, obstacles, rules, terms, labels, memory, breach_log
            )


@jit_inline
def judge_goals(
    b: int,
    tick: int,
    cars: int,
    spacing: Spacing,
    state: State,
    roads: RoadTable,
    obstacles: ObstacleLanes,
    rules: RuleTable,
    terms: RefereeParameters,
    labels: Labels,
    breach_log: BreachLog,
) -> None:
    """E6: no goal is taken for too long; find when one will be, or has to be looked at, if no car comes or goes."""
    ago = terms.whole[b, GOAL_TICKS]
    clock, ticks_paused = breach_log.goal_clock, breach_log.goal_paused
    due = NEVER_DUE
    for g in range(terms.goal_off[b], terms.goal_off[b + 1]):
        who = at_goal(terms.goal[g], cars, labels.at[b], breach_log.clock[b])
        long = run(who >= 0, tick, clock, g)
        if long < 0:
            continue
        paused, again = _holds_up(
            b, terms.goal[g], tick, cars, spacing, state, roads, obstacles, rules, terms, labels, breach_log
        )
        if long == 0:
            ticks_paused[g] = 0
        elif paused:
            ticks_paused[g] += 1
        if long - ticks_paused[g] == ago and (long == 0 or not paused):
            add(b, GOAL, who, tick, clock[g], terms.goal[g], -1, breach_log.row, breach_log.filled)
        due = min(due, again)
        due = min(due, when_due(tick, clock, g, ago + ticks_paused[g]))
    breach_log.goal_due[b] = due


@jit_inline
def _holds_up(
    b: int,
    v: int,
    tick: int,
    cars: int,
    spacing: Spacing,
    state: State,
    roads: RoadTable,
    obstacles: ObstacleLanes,
    rules: RuleTable,
    terms: RefereeParameters,
    labels: Labels,
    breach_log: BreachLog,
) -> tuple[bool, int]:
    """E6: tell whether no exit of the goal v is free, for any e-agent in it, and the ego is near one.

    Also returns when to ask again, if no car comes or goes.
    """
    row = roads.vert_off[rules.whole[b, NET]] + v
    vx, vy = float(roads.vert[row, 0]), float(roads.vert[row, 1])
    dx, dy = state.x[b, EGO] - vx, state.y[b, EGO] - vy
    spare = (
        sqrt(dx * dx + dy * dy) - terms.real[b, LONE] - terms.real[b, GOAL_GAP] - rules.real[b, LANE_WIDTH]
    )
    if spare > 0.0:
        return False, tick + ticks_within(spare, spacing, b)
    near = False
    for n in range(1, cars):
        if labels.at[b, n] != v:
            continue
        back = way_back(b, v, breach_log.clock[b, n, CAME_BY], roads, rules)
        count = list_near(state, b, tick, vx, vy, terms.real[b, LONE], spacing)
        if find_exit(
            b, n, v, back, spacing.near, count, state, roads, obstacles, rules, terms, labels, breach_log
        ):
            return False, tick + 1
        near |= ego_at_exit(b, v, back, state, roads, rules, terms, labels)
    return near, tick + 1
