"""Judges what e-agents owe, E3 to E6 (docs/rules.md#E3), in one frame (compiled)."""

from __future__ import annotations

from typing import Any

import numpy as np

from dubins_traffic.cars.near import list_near
from dubins_traffic.cars.state import EGO
from dubins_traffic.kernels.compile import jit, jit_inline, jit_rare
from dubins_traffic.roads.lookup import lane_end, lane_length, lane_start
from dubins_traffic.rules.blocking import RightLane, lane_of, narrows, obstacle_narrows, place_in_lane
from dubins_traffic.rules.breach_log import NEVER_DUE, RULE, RefereeTables
from dubins_traffic.rules.breaches import FIRST_AND_CLEAR, add, at_goal, judge_queue, lasted, run, when_due
from dubins_traffic.rules.exits import ego_at_exit, find_exit, is_exit, lane_taken, look_for_exit, taken_exits, way_back
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.rules.tables import GRAIN

RETURNS = 0.85
"""Who passes an obstacle returns before a disc in this share of `overtaking_behind`, and the length of a rectangle."""
INSIDE = 1.5
"""The centre line of an arc is at most so many times as long as the middle of a lane on its inside."""


@jit_inline
def judge_agent(b: int, n: int, tick: int, tables: RefereeTables) -> int:
    """Judge E3 to E5 for e-agent n of trial b.

    Returns the next tick in which it has to be judged again if its labels stay the same.
    """
    log, terms, labels = tables.log, tables.terms[b], tables.labels
    car, lane, v = log.car[b, n], labels.lane[b, n], labels.crosses[b, n]
    bits = np.int64(labels.bits[b, n])
    if bits & FLAG.STOPPED != 0:
        judge_queue(b, n, tick, lane_end(tables.roads, tables.rules[b].net, lane), tables)
    else:
        car.first_since = -1
    if car.crosses != v or v < 0:
        car.exit_since = -1
        car.exit_counts = -1
        car.exit_spent = car.exit_over = 0
    due = when_due(tick, car.first_since, terms.enter_ticks)
    if v >= 0:
        due = min(due, _judge_exit(b, n, tick, v, tables))
        if v != car.last_disc:
            car.last_disc, car.journey_since = v, tick
            car.journey_spent = car.journey_excused = car.journey_over = 0
    return min(due, _judge_journey(b, n, tick, tables))


@jit_inline
def _judge_journey(b: int, n: int, tick: int, tables: RefereeTables) -> int:
    """Judge E5 for e-agent n of trial b; return the tick in which to judge again if the car's labels stay the same.

    Norm: docs/rules.md#E5, docs/rules.md#journey.
    """
    log, terms, labels = tables.log, tables.terms[b], tables.labels
    car = log.car[b, n]
    start = min(terms.start_ticks, terms.journey_ticks)
    long = tick - car.journey_since
    if long < start:
        return car.journey_since + start
    if long > start:
        counts = car.exit_counts >= 0
        if labels.crosses[b, n] < 0:
            excused, lasts = excuse_of(b, n, tick, tables)
            car.journey_excused += 1 if excused and not lasts else 0
            counts = _is_way_free(b, n, excused, lasts, tables)
        car.journey_spent += 1 if counts else 0
    if car.journey_over == 0 and start + car.journey_spent == terms.journey_ticks:
        car.journey_over = 1
        add(log, car, RULE.JOURNEY, tick, car.journey_since, -1, labels.lane[b, n])
    return tick + 1


@jit
def _judge_exit(b: int, n: int, tick: int, v: int, tables: RefereeTables) -> int:
    """Judge E4 for e-agent n of trial b, whose body meets the disc of v.

    Ticks do not count while the ego, too, is in the disc and came there later or in the same tick, at most
    `shared_time` ago, unless the car's centre has been out of it. Returns the tick in which to judge again if the car's
    labels stay the same.

    Norm: docs/rules.md#E4, docs/rules.md#pause.
    """
    log, terms = tables.log, tables.terms[b]
    car, ego = log.car[b, n], log.car[b, EGO]
    back = way_back(v, car.came_by, tables.roads, tables.rules[b])
    free, again = look_for_exit(b, n, tick, v, back, tables)
    if lane_taken(b, n, v, tables) >= 0:
        car.been_out = 1
    paused = False
    if tables.labels.crosses[b, EGO] == v and car.been_out == 0:
        paused = ego.in_since >= car.in_since and tick - ego.in_since <= terms.shared_ticks
    if not free and car.exit_since >= 0:
        car.exit_spent += tick - 1 - car.exit_since - car.exit_paused
    car.exit_since = run(free, tick, car.exit_since)
    long = lasted(tick, car.exit_since)
    if long <= 0:
        car.exit_paused = 0
    elif paused:
        car.exit_paused += 1
    ago = terms.exit_ticks - car.exit_spent + car.exit_paused
    if car.exit_over == 0 and long >= 0 and long == ago and (long == 0 or not paused):
        car.exit_over = 1
        add(log, car, RULE.EXIT, tick, car.in_since, v, tables.labels.lane[b, n])
    car.exit_counts = -1 if paused else car.exit_since
    if paused:
        return tick + 1
    return min(again, when_due(tick, car.exit_since, ago))


@jit_rare
def excuse_of(b: int, n: int, tick: int, tables: RefereeTables) -> tuple[bool, bool]:
    """Return whether car n of trial b, in a lane, is excused for not coming on (E5), and for as long as this is so.

    Its way ahead is not free. What excuses for so long at most in a journey is the ego near it while it is left, or a
    bend without a free exit that is no goal.

    Norm: docs/rules.md#way, docs/rules.md#moving-up.
    """
    roads, labels, row = tables.roads, tables.labels, tables.memory.car[b]
    rules, terms = tables.rules[b], tables.terms[b]
    lane = labels.lane[b, n]
    bits = np.int64(labels.bits[b, n])
    if lane < 0 or (bits & FLAG.STOPPED != 0 and bits & FIRST_AND_CLEAR != FIRST_AND_CLEAR):
        return True, True
    if bits & FLAG.LEFT != 0:
        return _is_by_ego(b, n, tables), False
    here = row[n].progress
    place = lane_of(roads, rules, b, lane)
    v = lane_end(roads, rules.net, lane)
    excused = _is_narrow(b, n, place, here, tables) or _lacks_room(b, n, place, here, v, tables)
    vertex = int(roads.vert_off[rules.net]) + v
    degree = roads.degree[vertex]
    if excused or degree >= rules.crossing_degree or place.length - rules.radius - here > terms.way:
        return excused, True
    for k in range(tables.state.count[b]):
        if k != n and labels.crosses[b, k] == v and (k == EGO or tables.log.car[b, k].came_by == lane):
            return True, True
    vx, vy = roads.vertex[vertex].x, roads.vertex[vertex].y
    count = list_near(tables.state, b, tick, vx, vy, terms.lone, tables.spacing)
    if find_exit(b, n, v, way_back(v, lane, roads, rules), count, tables):
        return False, False
    return True, degree > 2 or _is_goal(b, v, tables)


@jit_inline
def _is_way_free(b: int, n: int, excused: bool, lasts: bool, tables: RefereeTables) -> bool:
    """Tell whether the way of car n counts as free; the rest is as `excuse_of` says."""
    spent = tables.log.car[b, n].journey_excused > tables.terms[b].excused_ticks
    return not excused or (not lasts and spent)


@jit_inline
def _is_goal(b: int, v: int, tables: RefereeTables) -> bool:
    """Tell whether the intersection v is a goal of trial b."""
    terms = tables.terms[b]
    goal = False
    for g in range(terms.goals_begin, terms.goals_end):
        goal |= tables.log.goal[g].vertex == v
    return goal


@jit_inline
def _is_by_ego(b: int, n: int, tables: RefereeTables) -> bool:
    """Tell whether the ego is so near to car n of trial b that it may hem it in."""
    state = tables.state
    dx, dy = state.x[b, EGO] - state.x[b, n], state.y[b, EGO] - state.y[b, n]
    return n != EGO and dx * dx + dy * dy <= tables.rules[b].hem2


@jit_inline
def _is_narrow(b: int, n: int, place: RightLane, here: float, tables: RefereeTables) -> bool:
    """Tell whether a body, standing or not, narrows the lane ahead of car n, whose progress is `here` (m)."""
    rules, way = tables.rules[b], tables.terms[b].way
    for k in range(tables.state.count[b]):
        if k != n and tables.labels.segment[b, k] == place.lane // 2:
            progress, low, high = place_in_lane(b, k, place.lane, tables.state, tables.roads, rules)
            near = 0.0 < progress - here <= way
            if near and narrows(low, high, rules.lane_width, rules.free_needed + GRAIN):
                return True
    return False


@jit_inline
def _lacks_room(b: int, n: int, place: RightLane, here: float, v: int, tables: RefereeTables) -> bool:
    """Tell whether an obstacle narrows the lane ahead of car n, and it may lack the room to pass that now.

    It lacks it if obstacles narrow the left lane, too, or the right one up to the disc of v at its end; or if another
    car is in that disc or on the road, unless it is behind, in the same lane or in the disc where that begins, and not
    the ego near by that does not stand, and may come beside it.

    Norm: docs/rules.md#lacks-room.
    """
    obstacles, rules, way, labels = tables.obstacles, tables.rules[b], tables.terms[b].way, tables.labels
    needed = rules.free_needed + GRAIN
    if not obstacle_narrows(obstacles, place, here, here + way, needed):
        return False
    room = 2.0 * rules.half_length + RETURNS * rules.overtaking_behind
    if tables.roads.segment[int(tables.roads.seg_off[rules.net]) + (place.lane >> 1)].piece >= 0:
        room *= INSIDE
    if obstacle_narrows(obstacles, place, max(here, place.length - rules.radius - room), here + way, needed):
        return True
    left, there = lane_of(tables.roads, rules, b, place.lane ^ 1), place.length - here
    if obstacle_narrows(obstacles, left, there - 2.0 * way, there, needed):
        return True
    begin = lane_start(tables.roads, rules.net, place.lane)
    for k in range(tables.state.count[b]):
        if k == n:
            continue
        bits = np.int64(labels.bits[b, k])
        rear = here - way - GRAIN if k == EGO and bits & FLAG.STANDS == 0 else here
        behind = labels.at[b, k] == begin or (labels.lane[b, k] == place.lane and bits & FLAG.LEFT == 0)
        behind = behind and place_in_lane(b, k, place.lane, tables.state, tables.roads, rules)[0] < rear
        if labels.crosses[b, k] == v or (labels.segment[b, k] == place.lane // 2 and not behind):
            return True
    return False


@jit
def find_ways(tick: int, tables: RefereeTables, ways: Any) -> None:
    """Write into `ways` (B, N) which cars have a free way ahead (E5) in frame `tick`, which has been judged."""
    for b in range(tables.state.count.shape[0]):
        for n in range(tables.state.count[b]):
            excused, lasts = excuse_of(b, n, tick, tables)
            ways[b, n] = _is_way_free(b, n, excused, lasts, tables)


@jit
def judge_goals(b: int, tick: int, tables: RefereeTables) -> None:
    """Judge E6 in trial b: no goal is taken for too long.

    Sets `BreachLog.goal_due`, the tick in which to judge again if no car comes or goes.

    Norm: docs/rules.md#E6.
    """
    log, terms = tables.log, tables.terms[b]
    due = NEVER_DUE
    for g in range(terms.goals_begin, terms.goals_end):
        goal = log.goal[g]
        who = at_goal(goal.vertex, tables.state.count[b], tables.labels.at[b], log.car[b])
        goal.since = run(who >= 0, tick, goal.since)
        long = lasted(tick, goal.since)
        if long < 0:
            continue
        paused, again = _holds_up(b, goal.vertex, tick, tables)
        if long == 0:
            goal.paused = 0
        elif paused:
            goal.paused += 1
        ago = terms.goal_ticks + goal.paused
        if long == ago and (long == 0 or not paused):
            add(log, log.car[b, who], RULE.GOAL, tick, goal.since, goal.vertex, -1)
        due = min(due, again, when_due(tick, goal.since, ago))
    log.goal_due[b] = due


@jit
def _holds_up(b: int, v: int, tick: int, tables: RefereeTables) -> tuple[bool, int]:
    """Tell whether the ego holds up the goal v (E6): no e-agent in it has a free exit.

    The ego also is near an exit, or one of those e-agents waits for it. Also returns the tick in which to ask again if
    no car comes or goes.
    """
    roads, rules = tables.roads, tables.rules[b]
    near = False
    for n in range(EGO + 1, tables.state.count[b]):
        if tables.labels.at[b, n] != v:
            continue
        back = way_back(v, tables.log.car[b, n].came_by, roads, rules)
        free, again = look_for_exit(b, n, tick, v, back, tables)
        if free:
            return False, again
        near = near or ego_at_exit(b, v, back, tables)
    if not near:
        find_waiting(b, tick, tables)
        for n in range(EGO + 1, tables.state.count[b]):
            near |= tables.labels.at[b, n] == v and tables.log.car[b, n].waits != 0
    return near, tick + 1


@jit_rare
def find_waiting(b: int, tick: int, tables: RefereeTables) -> None:
    """Set `JudgedCar.waits` of the cars of trial b: the ego, and who waits for one that waits, and so on.

    Norm: docs/rules.md#waits.
    """
    cars, log = tables.state.count[b], tables.log
    for n in range(cars):
        log.car[b, n].waits = 1 if n == EGO else 0
    grows = True
    while grows:
        grows = False
        for n in range(EGO + 1, cars):
            if log.car[b, n].waits == 0 and (_waits_in_lane(b, n, tables) or _waits_in_disc(b, n, tick, tables)):
                log.car[b, n].waits = 1
                grows = True


@jit
def _waits_in_lane(b: int, n: int, tables: RefereeTables) -> bool:
    """Tell whether one that waits for the ego is ahead of car n, in the disc ahead of it, or beside what blocks it."""
    labels, roads, row, net = tables.labels, tables.roads, tables.memory.car[b], tables.rules[b].net
    lane, far = labels.lane[b, n], tables.terms[b].way
    if lane < 0:
        return False
    here, v = row[n].progress, lane_end(roads, net, lane)
    blocked = np.int64(labels.bits[b, n]) & FLAG.BLOCKED != 0
    arrives = lane_length(roads, net, lane) - tables.rules[b].radius - here <= far
    for k in range(tables.state.count[b]):
        if k == n or tables.log.car[b, k].waits == 0:
            continue
        ahead = labels.lane[b, k] == lane and 0.0 < row[k].progress - here <= far
        if ahead or (arrives and labels.crosses[b, k] == v) or (blocked and labels.segment[b, k] == lane // 2):
            return True
    return False


@jit
def _waits_in_disc(b: int, n: int, tick: int, tables: RefereeTables) -> bool:
    """Tell whether car n is in a disc without a free exit, and a car that waits for the ego is there or takes one."""
    labels, roads, rules = tables.labels, tables.roads, tables.rules[b]
    v: int = labels.crosses[b, n]
    if v < 0:
        return False
    back = way_back(v, tables.log.car[b, n].came_by, roads, rules)
    row = int(roads.vert_off[rules.net]) + v
    only = lane_taken(b, n, v, tables)
    exits = 0
    for arm in range(roads.degree[row]):
        exits |= 1 << arm if is_exit(int(roads.arms[row, arm]), only, back) else 0
    held = False
    for k in range(tables.state.count[b]):
        if k != n and tables.log.car[b, k].waits != 0 and not held:
            held = labels.crosses[b, k] == v or taken_exits(b, n, k, v, back, tables) & exits != 0
    if not held:
        return False
    x, y = roads.vertex[row].x, roads.vertex[row].y
    count = list_near(tables.state, b, tick, x, y, tables.terms[b].lone, tables.spacing)
    return not find_exit(b, n, v, back, count, tables)
