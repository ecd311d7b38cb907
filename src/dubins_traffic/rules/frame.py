"""The propositions of one frame, for all cars of a batch.

Their order is docs/rules.md#order-in-a-frame: lane state, still, queue, blocked, overtaking, left.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dubins_traffic.cars.state import Labels, State
from dubins_traffic.kernels.compile import jit, jit_inline, jit_inner
from dubins_traffic.roads.lookup import (
    lane_coordinates,
    lane_direction,
    lane_end,
)
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.blocking import narrows, obstacle_narrows
from dubins_traffic.rules.label_cache import holds_on, look_who_holds
from dubins_traffic.rules.location import locate, moved2, put_in_order
from dubins_traffic.rules.obstacles import ObstacleLanes
from dubins_traffic.rules.propositions import (
    AHEAD,
    APPROACH,
    BLOCKED,
    CLEAR,
    ENTERED,
    EXCUSED,
    FIRST,
    FORFEITED,
    IN_CROSSING,
    LEFT,
    LINGERS,
    OVERTAKING,
    STANDS,
    STILL,
    STOPPED,
)
from dubins_traffic.rules.queue import foremost, keep_order
from dubins_traffic.rules.shape import half_extent
from dubins_traffic.rules.tables import (
    APPROACH2,
    APPROACH_SINCE,
    BLOCKED_AHEAD,
    CROSS2,
    CROSSERS,
    DUE,
    EXCUSE,
    FIRST_SINCE,
    FORFEITS,
    FREE_NEEDED,
    GAP2,
    HALF_LENGTH,
    HALF_WIDTH,
    LANE,
    LANE_WIDTH,
    LEFT_RELEASE,
    LEFT_SET,
    NET,
    NEXT_IN_LANE,
    NEXT_IN_QUEUE,
    NEXT_ON_SEGMENT,
    OVERTAKING_AHEAD,
    OVERTAKING_BEHIND,
    PROGRESS,
    QUEUE,
    QUEUE2,
    RANK,
    REACH,
    ROUNDING,
    SEGMENT,
    STOP2,
    STOP_MOVE2,
    STOP_TICKS,
    TICKET,
    WAIT_SINCE,
    ZONE,
    Memory,
    RuleTable,
)

LONG = STILL | LINGERS
BESIDE = LONG | LEFT | OVERTAKING
"""Flags of the cars about which there is something to say beside their lane: who stands, is left or overtakes."""


@jit
def label_frame(
    tick: int,
    state: State,
    roads: RoadTable,
    obstacles: ObstacleLanes,
    rules: RuleTable,
    labels: Labels,
    memory: Memory,
) -> None:
    """Label frame `tick` of every trial: labels and memory hold those of the frame before and are updated.

    Before frame 0 both are as they are made: no lane, no vertex, no flag.
    """
    for b in range(state.count.shape[0]):
        label_trial(b, tick, state, roads, obstacles, rules, labels, memory)


@jit_inner
def label_trial(
    b: int,
    tick: int,
    state: State,
    roads: RoadTable,
    obstacles: ObstacleLanes,
    rules: RuleTable,
    labels: Labels,
    memory: Memory,
) -> None:
    """Label frame `tick` of one trial."""
    look_who_holds(b, tick, state, rules, memory)
    cars = state.count[b]
    stirred = False
    due = 0
    some = 0
    for n in range(cars):
        if not holds_on(b, n, roads, rules, labels, memory):
            stirred |= locate(b, n, tick, state, roads, rules, labels, memory)
        elif memory.mark[b, n, ZONE] == 0:
            some |= np.int64(labels.bits[b, n])
            continue
        memory.link[b, due, DUE] = n
        due += 1
    for k in range(cars if stirred else due):
        n = k if stirred else memory.link[b, k, DUE]
        some |= _stop(b, n, tick, state, roads, rules, labels, memory)
    if some & STOPPED != 0:
        _queue_up(b, tick, cars, roads, rules, labels, memory)
    elif some & LONG != 0:
        for n in range(cars):
            _say_stands(b, n, labels)
    if some & BESIDE != 0 or obstacles.base[b] >= 0:
        _look_beside(b, state, roads, obstacles, rules, labels, memory)


@jit_inline
def _queue_up(
    b: int, tick: int, cars: int, t: RoadTable, rules: RuleTable, labels: Labels, memory: Memory
) -> None:
    """Order the queues, and say who stands."""
    head = memory.head[b]
    for n in range(cars):
        _queue(b, n, tick, t, rules, labels, memory)
    for n in range(cars):
        lane = labels.lane[b, n]
        if lane >= 0 and head[lane, LANE] == n:
            put_in_order(b, lane, memory)
    for n in range(cars):
        _stand(b, n, rules, labels, memory)
    for n in range(cars):
        if labels.bits[b, n] & STOPPED != 0:
            head[lane_end(t, rules.whole[b, NET], labels.lane[b, n]), QUEUE] = -1


@jit_inline
def _look_beside(
    b: int, state: State, roads: RoadTable, obstacles: ObstacleLanes, rules: RuleTable, labels: Labels,
    memory: Memory,
) -> None:  # fmt: skip
    """Find who is blocked, overtakes and is left."""
    head = memory.head[b]
    for n in range(state.count[b]):
        memory.link[b, n, NEXT_ON_SEGMENT] = head[labels.segment[b, n], SEGMENT]
        head[labels.segment[b, n], SEGMENT] = n
    for n in range(state.count[b]):
        _block(b, n, state, roads, obstacles, rules, labels, memory)
    for n in range(state.count[b]):
        head[labels.segment[b, n], SEGMENT] = -1


@jit_inline
def _stop(
    b: int, n: int, tick: int, state: State, t: RoadTable, rules: RuleTable, labels: Labels, memory: Memory
) -> Any:
    """Find whether a car approaches, has stopped and gets a ticket; enter it in the queue ahead.

    Sets CLEAR too, which needs who crosses what. Returns the car's flags so far, with LEFT if it will be left.
    """
    net: int = rules.whole[b, NET]
    real = rules.real
    mark = memory.mark
    gap2 = memory.measure[b, n, GAP2]
    lane = labels.lane[b, n]
    crosses = labels.crosses[b, n]
    bits = np.int64(labels.bits[b, n]) & ~CLEAR
    mark[b, n, RANK] = -1
    if gap2 < 0.0:
        if bits & IN_CROSSING != 0 and memory.head[b, crosses, CROSSERS] == 1:
            bits |= CLEAR
        bits &= ~STOPPED
        labels.bits[b, n] = bits
        return bits | (LEFT if memory.measure[b, n, REACH] > real[b, LEFT_SET] else 0)
    v = lane_end(t, net, lane)
    own = 1 if crosses == v else 0
    if memory.head[b, v, CROSSERS] == own:
        bits |= CLEAR
    outside = gap2 >= real[b, CROSS2]
    if not outside:
        mark[b, n, WAIT_SINCE] = -1
    if not outside or gap2 > real[b, QUEUE2]:
        bits &= ~STOPPED
    if outside and gap2 <= real[b, STOP2] and foremost(rules, memory, b, n, lane):
        if gap2 <= real[b, APPROACH2]:
            bits |= APPROACH
        if mark[b, n, APPROACH_SINCE] < 0:
            mark[b, n, APPROACH_SINCE] = tick
        ago = rules.whole[b, STOP_TICKS]
        long = tick - mark[b, n, APPROACH_SINCE] >= ago
        if bits & STOPPED == 0 and long:
            moved = moved2(b, n, tick, state.x[b, n], state.y[b, n], ago, memory)
            if moved <= real[b, STOP_MOVE2]:
                bits |= STOPPED
                mark[b, n, TICKET] = tick
                mark[b, n, FORFEITS] = 0 if mark[b, n, WAIT_SINCE] < 0 else mark[b, n, FORFEITS] + 1
                mark[b, n, FIRST_SINCE] = -1
                if mark[b, n, WAIT_SINCE] < 0:
                    mark[b, n, WAIT_SINCE] = tick
    else:
        mark[b, n, APPROACH_SINCE] = -1
    if bits & STOPPED != 0:
        memory.link[b, n, NEXT_IN_QUEUE] = memory.head[b, v, QUEUE]
        memory.head[b, v, QUEUE] = n
    labels.bits[b, n] = bits
    return bits | (LEFT if memory.measure[b, n, REACH] > real[b, LEFT_SET] else 0)


@jit
def _queue(b: int, n: int, tick: int, t: RoadTable, rules: RuleTable, labels: Labels, memory: Memory) -> None:
    """Order the queue of which car n is the head of the list, and flag its cars."""
    if labels.bits[b, n] & STOPPED == 0:
        return
    net: int = rules.whole[b, NET]
    v = lane_end(t, net, labels.lane[b, n])
    if memory.head[b, v, QUEUE] != n:
        return
    clear = memory.head[b, v, CROSSERS] == 0
    keep_order(t, rules, labels.lane, memory, b, net, n, clear, tick)
    member = n
    while member >= 0:
        flags = FIRST if memory.mark[b, member, RANK] == 0 else AHEAD
        if memory.mark[b, member, FORFEITS] > 0:
            flags |= FORFEITED
        else:
            flags |= EXCUSED
        labels.bits[b, member] = np.int64(labels.bits[b, member]) | flags
        member = memory.link[b, member, NEXT_IN_QUEUE]


@jit
def _stand(b: int, n: int, rules: RuleTable, labels: Labels, memory: Memory) -> None:
    """Excuse the cars close behind excused ones, and say who stands, in the lane of which car n is foremost.

    A car without lane state is excused by nothing.
    """
    lane = labels.lane[b, n]
    if lane < 0:
        _say_stands(b, n, labels)
        return
    if memory.head[b, lane, LANE] != n:
        return
    measure = memory.measure
    start = n
    member = n
    while member >= 0:
        progress = measure[b, member, PROGRESS]
        while measure[b, start, PROGRESS] - progress > rules.real[b, EXCUSE]:
            start = memory.link[b, start, NEXT_IN_LANE]
        other = start
        while other != member and measure[b, other, PROGRESS] > progress:
            if labels.bits[b, other] & EXCUSED != 0:
                labels.bits[b, member] = np.int64(labels.bits[b, member]) | EXCUSED
                break
            other = memory.link[b, other, NEXT_IN_LANE]
        _say_stands(b, member, labels)
        member = memory.link[b, member, NEXT_IN_LANE]


@jit
def _say_stands(b: int, n: int, labels: Labels) -> None:
    bits = np.int64(labels.bits[b, n])
    if bits & EXCUSED == 0 and bits & LONG != 0:
        labels.bits[b, n] = bits | STANDS


@jit
def _block(
    b: int,
    n: int,
    state: State,
    t: RoadTable,
    obstacles: ObstacleLanes,
    rules: RuleTable,
    labels: Labels,
    memory: Memory,
) -> None:
    """Find whether the lane of a car is blocked, whether it overtakes, and whether it is left."""
    real = rules.real
    lane = labels.lane[b, n]
    bits = np.int64(labels.bits[b, n])
    if lane < 0:
        labels.bits[b, n] = bits & ~(OVERTAKING | LEFT)
        return
    net: int = rules.whole[b, NET]
    tx, ty = lane_direction(t, net, lane)
    own = memory.measure[b, n, PROGRESS]
    width = real[b, LANE_WIDTH]
    needed = real[b, FREE_NEEDED]
    blocked = False
    beside = False
    other = memory.head[b, lane // 2, SEGMENT]
    while other >= 0:
        if other != n and labels.bits[b, other] & STANDS != 0:
            progress, lateral = lane_coordinates(t, net, lane, state.x[b, other], state.y[b, other])
            half = half_extent(
                tx, ty, state.c[b, other], state.s[b, other],
                real[b, HALF_LENGTH], real[b, HALF_WIDTH], real[b, ROUNDING],
            )  # fmt: skip
            ahead = progress - own
            if narrows(lateral - half, lateral + half, width, needed):
                blocked = blocked or 0.0 < ahead <= real[b, BLOCKED_AHEAD]
                beside = beside or -real[b, OVERTAKING_BEHIND] <= ahead <= real[b, OVERTAKING_AHEAD]
        other = memory.link[b, other, NEXT_ON_SEGMENT]
    if obstacles.base[b] >= 0:
        length = t.seg[t.seg_off[net] + lane // 2, 4]
        blocked = blocked or obstacle_narrows(
            obstacles, b, lane, length, own, own + real[b, BLOCKED_AHEAD], width, needed
        )
        beside = beside or obstacle_narrows(
            obstacles, b, lane, length,
            own - real[b, OVERTAKING_BEHIND], own + real[b, OVERTAKING_AHEAD], width, needed,
        )  # fmt: skip
    if blocked:
        bits |= BLOCKED | OVERTAKING
    elif not beside and bits & LEFT == 0:
        bits &= ~OVERTAKING
    if bits & ENTERED != 0 or labels.crosses[b, n] == lane_end(t, net, lane):
        bits &= ~OVERTAKING
    reach = memory.measure[b, n, REACH]
    if reach > real[b, LEFT_SET]:
        bits |= LEFT
    elif reach < real[b, LEFT_RELEASE]:
        bits &= ~LEFT
    labels.bits[b, n] = bits
