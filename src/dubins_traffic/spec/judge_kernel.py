"""The referee's look at one frame of a batch: which rules are broken in it, by whom, since when, where."""

from __future__ import annotations

from typing import Any

import numpy as np

from dubins_traffic.cars.state import Labels, State
from dubins_traffic.kernels.arrays import Bits, Floats, Ints
from dubins_traffic.kernels.compile import jit, jit_inline, jit_inner
from dubins_traffic.roads.lookup import lane_end
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.spec.docket import (
    AT,
    AT_SINCE,
    AT_TICK,
    AT_VERTEX,
    BITS,
    CLEARANCE,
    CROSSES,
    ENTER,
    ENTER_TICKS,
    EXIT,
    EXIT_SINCE,
    EXIT_TICKS,
    FIRST_SINCE,
    GOAL,
    GOAL_TICKS,
    JUDGED,
    LANE,
    LEFT_SINCE,
    LEFT_UNBLOCKED,
    MOST_TICKETS,
    NEAR2,
    OF_CAR,
    OF_RULE,
    OF_TRIAL,
    OFF_ROAD,
    ON_LANE,
    ORDER,
    REST,
    REST_SINCE,
    REST_TICKS,
    RETURN,
    RETURN_TICKS,
    ROAD,
    SINCE_TICK,
    STOP,
    STOPPED_SINCE,
    TICKETS,
    UNBLOCKED_SINCE,
    WAY,
    Docket,
    Terms,
)
from dubins_traffic.spec.exits import has_exit
from dubins_traffic.spec.frame import label_tables
from dubins_traffic.spec.obstacles import ObstacleLanes
from dubins_traffic.spec.propositions import (
    AHEAD,
    BLOCKED,
    CLEAR,
    ENTERED,
    EXCUSED,
    FIRST,
    IN_CROSSING,
    LEFT,
    ON_ROAD,
    OVERTAKING,
    STANDS,
    STOPPED,
)
from dubins_traffic.spec.tables import (
    FORFEITS,
    NET,
    PROGRESS,
    TICKET,
    Memory,
    RuleTable,
)

EGO: int = 0
ENTERS = ENTERED | IN_CROSSING
GOES = FIRST | CLEAR


# Where each table begins and ends among the arrays of a call.
STATE_END = len(State._fields)
ROADS_END = STATE_END + len(RoadTable._fields)
OBSTACLES_END = ROADS_END + len(ObstacleLanes._fields)
RULES_END = OBSTACLES_END + len(RuleTable._fields)
TERMS_END = RULES_END + len(Terms._fields)
LABELS_END = TERMS_END + len(Labels._fields)
MEMORY_END = LABELS_END + len(Memory._fields)


@jit
def judge_frame(tick: int, *arrays: Any) -> None:
    """Add the breaches that begin in frame `tick`, which has been labelled, to the docket.

    `arrays` are those of State, RoadTable, ObstacleLanes, RuleTable, Terms, Labels, Memory and Docket, one after
    another: a call from Python with arrays takes a third of the time of one with tables of them.
    """
    judge_tables(
        tick, State(*arrays[:STATE_END]), RoadTable(*arrays[STATE_END:ROADS_END]),
        ObstacleLanes(*arrays[ROADS_END:OBSTACLES_END]), RuleTable(*arrays[OBSTACLES_END:RULES_END]),
        Terms(*arrays[RULES_END:TERMS_END]), Labels(*arrays[TERMS_END:LABELS_END]),
        Memory(*arrays[LABELS_END:MEMORY_END]), Docket(*arrays[MEMORY_END:]),
    )  # fmt: skip


@jit_inner
def judge_tables(
    tick: int,
    state: State,
    roads: RoadTable,
    obstacles: ObstacleLanes,
    rules: RuleTable,
    terms: Terms,
    labels: Labels,
    memory: Memory,
    docket: Docket,
) -> None:
    """Do as `judge_frame`, for kernels."""
    for b in range(state.count.shape[0]):
        if terms.whole[b, JUDGED] != 0:
            judge_trial(b, tick, state, roads, obstacles, rules, terms, labels, memory, docket)


@jit_inner
def judge_trial(
    b: int,
    tick: int,
    state: State,
    roads: RoadTable,
    obstacles: ObstacleLanes,
    rules: RuleTable,
    terms: Terms,
    labels: Labels,
    memory: Memory,
    docket: Docket,
) -> None:
    """Do as `judge_frame`, of one trial."""
    row = docket.row
    filled = docket.filled
    cars = state.count[b]
    whole = terms.whole[b]
    past = docket.past[b]
    flags = labels.bits[b]
    lanes = labels.lane[b]
    for n in range(cars):
        clock = docket.clock[b, n]
        bits = np.int64(flags[n])
        lane = lanes[n]
        v = labels.crosses[b, n]
        if bits & LEFT != 0:
            _judge_lane(b, n, tick, bits, lane, whole, clock, row, filled)
        else:
            clock[LEFT_SINCE] = -1
            clock[UNBLOCKED_SINCE] = -1
        if bits & ENTERS == ENTERS:
            stopped = False
            if past[n, BITS] & STOPPED != 0:
                stopped = lane_end(roads, rules.whole[b, NET], past[n, LANE]) == v
            _judge_entry(b, n, tick, v, stopped, cars, past, row, filled)
        if n == EGO:
            _judge_road(b, tick, bits, lane, clock, row, filled)
            continue
        _judge_agent(b, n, tick, bits, lane, v, state, roads, obstacles, rules, terms, labels, memory, docket)
        if past[n, AT] != labels.at[b, n]:
            clock[AT_SINCE] = tick
    for g in range(terms.goal_off[b], terms.goal_off[b + 1]):
        who = _at_goal(terms.goal[g], cars, labels.at[b], docket.clock[b])
        if who < 0:
            docket.goal_clock[g] = -1
        elif docket.goal_clock[g] < 0:
            docket.goal_clock[g] = tick
        if who >= 0 and tick - docket.goal_clock[g] == whole[GOAL_TICKS]:
            _add(b, GOAL, who, tick, docket.goal_clock[g], terms.goal[g], -1, row, filled)
    for n in range(cars):
        past[n, BITS] = flags[n]
        past[n, LANE] = lanes[n]
        past[n, CROSSES] = labels.crosses[b, n]
        past[n, AT] = labels.at[b, n]


@jit_inline
def _judge_agent(
    b: int,
    n: int,
    tick: int,
    bits: Any,
    lane: int,
    v: int,
    state: State,
    roads: RoadTable,
    obstacles: ObstacleLanes,
    rules: RuleTable,
    terms: Terms,
    labels: Labels,
    memory: Memory,
    docket: Docket,
) -> None:
    """E3 to E5, of an e-agent in lane `lane` whose body meets the disc of v, or none (-1)."""
    whole, row, filled, clock = terms.whole[b], docket.row, docket.filled, docket.clock[b, n]
    if bits & STOPPED != 0:
        ahead = lane_end(roads, rules.whole[b, NET], lane)
        _judge_queue(b, n, tick, bits, lane, ahead, whole, memory.mark[b, n], clock, row, filled)
    else:
        clock[STOPPED_SINCE] = -1
        clock[FIRST_SINCE] = -1
    if docket.past[b, n, CROSSES] != v or v < 0:
        clock[EXIT_SINCE] = -1
    if v >= 0:
        free = _has_exit(b, n, v, state, roads, obstacles, rules, terms, labels)
        if _run(free, tick, clock, EXIT_SINCE) == whole[EXIT_TICKS]:
            _add(b, EXIT, n, tick, clock[EXIT_SINCE], v, lane, row, filled)
    free = lane >= 0 and bits & (STANDS | BLOCKED | STOPPED) == STANDS
    if free:
        free = _has_way(
            n, state.count[b], terms.real[b, WAY], labels.lane[b], labels.bits[b], memory.measure[b]
        )
    if _run(free, tick, clock, REST_SINCE) == whole[REST_TICKS]:
        _add(b, REST, n, tick, clock[REST_SINCE], -1, lane, row, filled)


@jit
def judge_frames(
    first: int,
    begin: int,
    room: int,
    poses: Floats,
    bits: Bits,
    state: State,
    roads: RoadTable,
    obstacles: ObstacleLanes,
    rules: RuleTable,
    terms: Terms,
    labels: Labels,
    memory: Memory,
    docket: Docket,
) -> int:
    """Label and judge `poses` (4: x, y, c, s; F, N) of one trial from row `begin` on; return the row after the last.

    Row f is frame `first` + f. The flags found are written to `bits` (F, N). Ends early when there may not be room
    in `docket` for another frame, which needs `room` rows.
    """
    for f in range(begin, poses.shape[1]):
        if docket.filled[0] + room > docket.row.shape[0]:
            return f
        for n in range(poses.shape[2]):
            state.x[0, n] = poses[0, f, n]
            state.y[0, n] = poses[1, f, n]
            state.c[0, n] = poses[2, f, n]
            state.s[0, n] = poses[3, f, n]
        label_tables(first + f, state, roads, obstacles, rules, labels, memory)
        judge_tables(first + f, state, roads, obstacles, rules, terms, labels, memory, docket)
        for n in range(poses.shape[2]):
            bits[f, n] = labels.bits[0, n]
    return poses.shape[1]


@jit
def _add(
    b: int, rule: int, n: int, tick: int, since: int, vertex: int, lane: int, row: Ints, filled: Ints
) -> None:
    k = filled[0]
    row[k, OF_TRIAL] = b
    row[k, OF_RULE] = rule
    row[k, OF_CAR] = n
    row[k, AT_TICK] = tick
    row[k, SINCE_TICK] = since
    row[k, AT_VERTEX] = vertex
    row[k, ON_LANE] = lane
    filled[0] = k + 1


@jit_inline
def _run(holds: bool, tick: int, clock: Ints, which: int) -> int:
    """Keep the clock of a run; return for how many ticks it has gone on, -1 if there is none."""
    if not holds:
        clock[which] = -1
        return -1
    if clock[which] < 0:
        clock[which] = tick
    return tick - clock[which]


@jit
def _judge_lane(
    b: int, n: int, tick: int, bits: Any, lane: int, whole: Ints, clock: Ints, row: Ints, filled: Ints
) -> None:
    """Rule 2: left only while overtaking, and for a while."""
    long = _run(bits & LEFT != 0, tick, clock, LEFT_SINCE)
    alone = _run(bits & (LEFT | OVERTAKING) == LEFT, tick, clock, UNBLOCKED_SINCE)
    if alone == 0:
        _add(b, LEFT_UNBLOCKED, n, tick, clock[LEFT_SINCE], -1, lane, row, filled)
    if long == whole[RETURN_TICKS]:
        _add(b, RETURN, n, tick, clock[LEFT_SINCE], -1, lane, row, filled)


@jit
def _judge_entry(
    b: int, n: int, tick: int, v: int, stopped: bool, cars: int, past: Ints, row: Ints, filled: Ints
) -> None:
    """Rule 3, of a car that enters crossing v in this frame: judged on the frame before, in which it had `stopped`
    there or not.
    """
    lane = past[n, LANE]
    if not stopped:
        _add(b, STOP, n, tick, tick, v, lane, row, filled)
    elif past[n, BITS] & AHEAD != 0:
        _add(b, ORDER, n, tick, tick, v, lane, row, filled)
    for k in range(cars):
        if k != n and past[k, CROSSES] == v:
            _add(b, CLEARANCE, n, tick, tick, v, lane, row, filled)
            return


@jit_inline
def _judge_road(b: int, tick: int, bits: Any, lane: int, clock: Ints, row: Ints, filled: Ints) -> None:
    """Rule 1: the ego stays on the road from its first frame there."""
    if bits & ON_ROAD != 0:
        clock[OFF_ROAD] = -1
    elif clock[OFF_ROAD] == -1:
        clock[OFF_ROAD] = tick
        _add(b, ROAD, EGO, tick, tick, -1, lane, row, filled)


@jit
def _judge_queue(
    b: int,
    n: int,
    tick: int,
    bits: Any,
    lane: int,
    v: int,
    whole: Ints,
    mark: Ints,
    clock: Ints,
    row: Ints,
    filled: Ints,
) -> None:
    """E3, of a car that has stopped at v: who is first at a clear crossing enters in time, and takes few tickets."""
    _run(True, tick, clock, STOPPED_SINCE)
    if _run(bits & GOES == GOES, tick, clock, FIRST_SINCE) == whole[ENTER_TICKS]:
        _add(b, ENTER, n, tick, clock[FIRST_SINCE], v, lane, row, filled)
    if mark[FORFEITS] == whole[MOST_TICKETS] + 1 and mark[TICKET] == tick:
        _add(b, TICKETS, n, tick, clock[STOPPED_SINCE], v, lane, row, filled)


@jit_inline
def _has_exit(
    b: int,
    n: int,
    v: int,
    state: State,
    t: RoadTable,
    obstacles: ObstacleLanes,
    rules: RuleTable,
    terms: Terms,
    labels: Labels,
) -> bool:
    """E4: tell whether car n, whose body meets the disc of v, may leave by some lane.

    Who is near with his centre outside the disc is in the way to one lane at most.
    """
    row = t.vert_off[rules.whole[b, NET]] + v
    vx, vy = t.vert[row, 0], t.vert[row, 1]
    far2 = terms.real[b, NEAR2]
    near = 0
    for k in range(state.count[b]):
        dx = state.x[b, k] - vx
        dy = state.y[b, k] - vy
        near += 1 if k != n and dx * dx + dy * dy <= far2 else 0
        near += 4 if k != n and labels.at[b, k] == v else 0
    if near < t.degree[row] and obstacles.base[b] < 0:
        return True
    return has_exit(b, n, v, state, t, obstacles, rules, terms, labels)


@jit
def _has_way(n: int, cars: int, reach: float, lanes: Ints, flags: Bits, measure: Floats) -> bool:
    """E5: tell whether nobody stands or waits within `reach` ahead of car n in its lane."""
    own = measure[n, PROGRESS]
    for k in range(cars):
        if lanes[k] == lanes[n] and flags[k] & (STANDS | EXCUSED | STOPPED) != 0:
            ahead = measure[k, PROGRESS] - own
            if 0.0 < ahead <= reach:
                return False
    return True


@jit_inline
def _at_goal(goal: int, cars: int, at: Ints, clock: Ints) -> int:
    """E6: return the e-agent that has been at a goal longest, -1 if none is there."""
    who = -1
    for n in range(1, cars):
        if at[n] == goal and (who < 0 or clock[n, AT_SINCE] < clock[who, AT_SINCE]):
            who = n
    return who
