"""The referee's look at one frame of a batch: which rules are broken in it, by whom, since when, where."""

from __future__ import annotations

from typing import Any

import numpy as np

from dubins_traffic.cars.near import Spacing, list_near
from dubins_traffic.cars.state import Labels, State
from dubins_traffic.kernels.arrays import Bits, Floats
from dubins_traffic.kernels.compile import jit, jit_inline, jit_inner
from dubins_traffic.roads.lookup import distance2, lane_end
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.breach_log import (
    AT,
    AT_SINCE,
    BITS,
    CAME_BY,
    CROSSES,
    IN_SINCE,
    JUDGED,
    LANE,
    LEFT_SINCE,
    LONE,
    NEVER_DUE,
    OFF_ROAD,
    UNBLOCKED_SINCE,
    BreachLog,
    RefereeParameters,
)
from dubins_traffic.rules.breaches import (
    EGO,
    judge_entry,
    judge_lane,
    judge_road,
)
from dubins_traffic.rules.duties import judge_agent, judge_goals
from dubins_traffic.rules.frame import label_frame
from dubins_traffic.rules.obstacles import ObstacleLanes
from dubins_traffic.rules.propositions import (
    ENTERED,
    IN_CROSSING,
    LEFT,
    ON_ROAD,
    STOPPED,
)
from dubins_traffic.rules.tables import (
    GRAIN,
    LEFT_RELEASE,
    LEFT_SET,
    NET,
    REACH,
    TICKET,
    Memory,
    RuleTable,
)

ENTERS = ENTERED | IN_CROSSING


@jit
def judge_frame(
    tick: int,
    state: State,
    roads: RoadTable,
    obstacles: ObstacleLanes,
    rules: RuleTable,
    terms: RefereeParameters,
    labels: Labels,
    memory: Memory,
    breach_log: BreachLog,
    spacing: Spacing,
) -> None:
    """Add the breaches that begin in frame `tick`, which has been labelled, to the breach_log."""
    for b in range(state.count.shape[0]):
        if terms.whole[b, JUDGED] != 0:
            judge_trial(b, tick, spacing, state, roads, obstacles, rules, terms, labels, memory, breach_log)


@jit_inner
def judge_trial(
    b: int,
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
) -> None:
    """Do as `judge_frame`, of one trial."""
    cars = state.count[b]
    count = _list_due(b, tick, cars, labels, memory, breach_log)
    arrived = tick == breach_log.goal_due[b]
    for i in range(count):
        n = breach_log.look[i]
        own = breach_log.past[b, n]
        arrived |= own[AT] != labels.at[b, n]
        if own[CROSSES] != labels.crosses[b, n]:
            breach_log.clock[b, n, IN_SINCE] = tick
            breach_log.clock[b, n, CAME_BY] = own[LANE]
    for i in range(count):
        n = breach_log.look[i]
        _judge_car(
            b, n, tick, spacing, state, roads, obstacles, rules, terms, labels, memory, breach_log
        )  # fmt: skip
    if arrived:
        judge_goals(
            b, tick, cars, spacing, state, roads, obstacles, rules, terms, labels, breach_log
        )  # fmt: skip
    for i in range(count):
        n = breach_log.look[i]
        own = breach_log.past[b, n]
        own[BITS] = labels.bits[b, n]
        own[LANE] = labels.lane[b, n]
        own[CROSSES] = labels.crosses[b, n]
        own[AT] = labels.at[b, n]


@jit_inline
def _list_due(b: int, tick: int, cars: int, labels: Labels, memory: Memory, breach_log: BreachLog) -> int:
    """List the cars of which something may begin, end or be due in this frame in `breach_log.look`; return how many.

    These are cars whose labels are not those of the frame before, who have got a ticket, or whose time has come; and
    all in discs, if the ego's body comes into one or leaves it.
    """
    past, due, look = breach_log.past[b], breach_log.due[b], breach_log.look
    joins = labels.crosses[b, EGO] != past[EGO, CROSSES]
    count = 0
    for n in range(cars):
        own = past[n]
        other = (np.int64(labels.bits[b, n]) ^ own[BITS]) | (labels.lane[b, n] ^ own[LANE])
        other |= (labels.crosses[b, n] ^ own[CROSSES]) | (labels.at[b, n] ^ own[AT])
        ticket = memory.mark[b, n, TICKET] == tick
        look[count] = n
        joined = joins & (labels.crosses[b, n] >= 0)
        count += 1 if (other != 0) | ticket | (tick >= due[n]) | joined else 0
    return count


@jit_inline
def _judge_car(
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
) -> None:
    """Judge a car of which something may have begun, and find when it has to be looked at again."""
    whole = terms.whole[b]
    clock = breach_log.clock[b, n]
    own = breach_log.past[b, n]
    bits = np.int64(labels.bits[b, n])
    lane = labels.lane[b, n]
    v = labels.crosses[b, n]
    due = tick + 1 if bits & LEFT != 0 else NEVER_DUE
    if _surely_left(b, bits, memory.measure[b, n, REACH], clock[LEFT_SINCE] >= 0, rules):
        judge_lane(b, n, tick, bits, lane, whole, clock, breach_log.row, breach_log.filled)
    else:
        clock[LEFT_SINCE] = -1
        clock[UNBLOCKED_SINCE] = -1
    if bits & ENTERS == ENTERS:
        stopped = False
        if own[BITS] & STOPPED != 0:
            stopped = lane_end(roads, rules.whole[b, NET], own[LANE]) == v
        _judge_entry(b, n, tick, v, stopped, spacing, state, roads, rules, terms, breach_log)
    if n == EGO:
        on = bits & ON_ROAD != 0
        if not on and clock[OFF_ROAD] == -1 and _by_the_road(b, state, roads, rules, labels):
            on, due = True, tick + 1
        judge_road(b, tick, on, lane, clock, breach_log.row, breach_log.filled)
    else:
        again = judge_agent(
            b, n, tick, bits, lane, v, spacing, state, roads, obstacles, rules, terms, labels, memory,
            breach_log,
        )  # fmt: skip
        due = min(due, again)
        if own[AT] != labels.at[b, n]:
            clock[AT_SINCE] = tick
    breach_log.due[b, n] = due


@jit_inline
def _surely_left(b: int, bits: Any, reach: float, was: bool, rules: RuleTable) -> bool:
    """Tell whether a car is left, and was or not before, by limits that are eased for it."""
    limit = rules.real[b, LEFT_RELEASE] if was else rules.real[b, LEFT_SET]
    return bits & LEFT != 0 and (reach >= limit + GRAIN if was else reach > limit + GRAIN)


@jit
def _by_the_road(b: int, state: State, roads: RoadTable, rules: RuleTable, labels: Labels) -> bool:
    """Tell whether the ego is off the road by no more than rounding can be."""
    net: int = rules.whole[b, NET]
    far = roads.half_width[net] + GRAIN
    x, y = float(state.x[b, EGO]), float(state.y[b, EGO])
    return distance2(roads, net, int(labels.segment[b, EGO]), x, y) <= far * far


@jit
def _judge_entry(
    b: int, n: int, tick: int, v: int, stopped: bool, spacing: Spacing, state: State, roads: RoadTable,
    rules: RuleTable, terms: RefereeParameters, breach_log: BreachLog,
) -> None:  # fmt: skip
    """Rule 3, of a car that enters crossing v and had `stopped` there in the frame before, or not."""
    row = roads.vert_off[rules.whole[b, NET]] + v
    far = terms.real[b, LONE] + 2.0 * spacing.drift[b]
    count = list_near(state, b, tick, float(roads.vert[row, 0]), float(roads.vert[row, 1]), far, spacing)
    judge_entry(
        b, n, tick, v, stopped, spacing.near, count, breach_log.past[b], breach_log.row, breach_log.filled
    )


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
    terms: RefereeParameters,
    labels: Labels,
    memory: Memory,
    breach_log: BreachLog,
    spacing: Spacing,
) -> int:
    """Label and judge `poses` (4: x, y, c, s; F, N) of one trial from row `begin` on; return the row after the last.

    Row f is frame `first` + f. The flags found are written to `bits` (F, N). Ends early when there may not be room
    in `breach_log` for another frame, which needs `room` rows.
    """
    for f in range(begin, poses.shape[1]):
        if breach_log.filled[0] + room > breach_log.row.shape[0]:
            return f
        for n in range(poses.shape[2]):
            state.x[0, n] = poses[0, f, n]
            state.y[0, n] = poses[1, f, n]
            state.c[0, n] = poses[2, f, n]
            state.s[0, n] = poses[3, f, n]
        label_frame(first + f, state, roads, obstacles, rules, labels, memory)
        judge_frame(first + f, state, roads, obstacles, rules, terms, labels, memory, breach_log, spacing)
        for n in range(poses.shape[2]):
            bits[f, n] = labels.bits[0, n]
    return poses.shape[1]
