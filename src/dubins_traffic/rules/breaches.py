"""The referee's looks at one car, compiled: clocks of runs, breaches by rule, and who is in the way."""

from __future__ import annotations

from typing import Any

from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.compile import jit_inline, jit_inner
from dubins_traffic.rules.breach_log import (
    AT_SINCE,
    AT_TICK,
    AT_VERTEX,
    BITS,
    CLEARANCE,
    CROSSES,
    ENTER,
    ENTER_TICKS,
    FIRST_SINCE,
    LANE,
    LEFT_SINCE,
    LEFT_UNBLOCKED,
    MOST_TICKETS,
    NEVER_DUE,
    OF_CAR,
    OF_RULE,
    OF_TRIAL,
    OFF_ROAD,
    ON_LANE,
    ORDER,
    RETURN,
    RETURN_TICKS,
    ROAD,
    SINCE_TICK,
    STOP,
    TICKETS,
    UNBLOCKED_SINCE,
)
from dubins_traffic.rules.propositions import (
    AHEAD,
    CLEAR,
    FIRST,
    LEFT,
    OVERTAKING,
)
from dubins_traffic.rules.tables import FORFEITS, TICKET, WAIT_SINCE

EGO: int = 0
GOES = FIRST | CLEAR


@jit_inner
def add(
    b: int, rule: int, n: int, tick: int, since: int, vertex: int, lane: int, row: Ints, filled: Ints
) -> None:
    """Write down a breach of car n in trial b."""
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
def run(holds: bool, tick: int, clock: Ints, which: int) -> int:
    """Keep the clock of a run; return for how many ticks it has gone on, -1 if there is none."""
    if not holds:
        clock[which] = -1
        return -1
    if clock[which] < 0:
        clock[which] = tick
    return tick - clock[which]


@jit_inline
def when_due(tick: int, clock: Ints, which: int, ago: int) -> int:
    """Return the tick in which a run will have gone on for `ago` ticks, `NEVER_DUE` if none will after this one."""
    due = clock[which] + ago
    return due if clock[which] >= 0 and due > tick else NEVER_DUE


@jit_inner
def judge_lane(
    b: int, n: int, tick: int, bits: Any, lane: int, whole: Ints, clock: Ints, row: Ints, filled: Ints
) -> None:
    """Rule 2: left only while overtaking, and for a while."""
    long = run(bits & LEFT != 0, tick, clock, LEFT_SINCE)
    alone = run(bits & (LEFT | OVERTAKING) == LEFT, tick, clock, UNBLOCKED_SINCE)
    if alone == 0:
        add(b, LEFT_UNBLOCKED, n, tick, clock[LEFT_SINCE], -1, lane, row, filled)
    if long == whole[RETURN_TICKS]:
        add(b, RETURN, n, tick, clock[LEFT_SINCE], -1, lane, row, filled)


@jit_inner
def judge_entry(
    b: int,
    n: int,
    tick: int,
    v: int,
    stopped: bool,
    near: Ints,
    count: int,
    past: Ints,
    row: Ints,
    filled: Ints,
) -> None:
    """Rule 3, of a car that enters crossing v in this frame: judged on the frame before, in which it had `stopped`
    there or not. The first `count` cars of `near` are all that may have been there.
    """
    lane = past[n, LANE]
    if not stopped:
        add(b, STOP, n, tick, tick, v, lane, row, filled)
    elif past[n, BITS] & AHEAD != 0:
        add(b, ORDER, n, tick, tick, v, lane, row, filled)
    for i in range(count):
        k = near[i]
        if k != n and past[k, CROSSES] == v:
            add(b, CLEARANCE, n, tick, tick, v, lane, row, filled)
            return


@jit_inline
def judge_road(b: int, tick: int, on: bool, lane: int, clock: Ints, row: Ints, filled: Ints) -> None:
    """Rule 1: the ego stays on the road from its first frame there; `on` tells whether it is there."""
    if on:
        clock[OFF_ROAD] = -1
    elif clock[OFF_ROAD] == -1:
        clock[OFF_ROAD] = tick
        add(b, ROAD, EGO, tick, tick, -1, lane, row, filled)


@jit_inner
def judge_queue(
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
    if run(bits & GOES == GOES, tick, clock, FIRST_SINCE) == whole[ENTER_TICKS]:
        add(b, ENTER, n, tick, clock[FIRST_SINCE], v, lane, row, filled)
    if mark[FORFEITS] == whole[MOST_TICKETS] + 1 and mark[TICKET] == tick:
        add(b, TICKETS, n, tick, mark[WAIT_SINCE], v, lane, row, filled)


@jit_inline
def at_goal(goal: int, cars: int, at: Ints, clock: Ints) -> int:
    """E6: return the e-agent that has been at a goal longest, -1 if none is there."""
    who = -1
    for n in range(1, cars):
        if at[n] == goal and (who < 0 or clock[n, AT_SINCE] < clock[who, AT_SINCE]):
            who = n
    return who
