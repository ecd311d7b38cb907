"""The propositions of one frame, for all cars of a batch.

Their order is docs/rules.md#order-in-a-frame: lane state, still, queue, blocked, left, overtaking, hemmed.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dubins_traffic.kernels.arrays import BLOCK
from dubins_traffic.kernels.compile import jit, jit_inline, jit_rare
from dubins_traffic.kernels.records import Rows
from dubins_traffic.roads.lookup import lane_end
from dubins_traffic.rules.blocking import lane_of, narrows, obstacle_narrows, place_in_lane
from dubins_traffic.rules.label_cache import check_label_caches, forget_region, relabel_from_cache
from dubins_traffic.rules.location import locate, moved2, put_in_order
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.rules.queue import Queue, foremost, gather, keep_order
from dubins_traffic.rules.tables import CarMemory, LabelTables

MOTIONLESS = FLAG.STILL | FLAG.LINGERS
NEEDS_OVERTAKING = MOTIONLESS | FLAG.LEFT | FLAG.OVERTAKING
"""Flags by which `_label_overtaking` is needed: a car is still, lingers, is left or overtakes."""


@jit
def label_frame(tick: int, tables: LabelTables) -> None:
    """Label frame `tick` of every trial; labels and memory hold those of the frame before and are updated in place.

    Before frame 0 both are as newly made: no lane, no vertex, no flag.
    """
    for b in range(tables.state.count.shape[0]):
        label_trial(b, tick, tables)


@jit
def label_trial(b: int, tick: int, tables: LabelTables) -> None:
    """Label frame `tick` of trial b.

    Norm: docs/rules.md#order-in-a-frame.
    """
    state, labels, memory = tables.state, tables.labels, tables.memory
    rules, row, due = tables.rules[b], memory.car[b], memory.due[b]
    check_label_caches(b, tick, state, rules, memory)
    cars = state.count[b]
    stirred = False
    count = 0
    some = 0
    for n in range(cars):
        if not relabel_from_cache(b, n, tables.roads, rules, labels, memory):
            stirred |= locate(b, n, tick, tables)
        elif row[n].zone == 0:
            some |= np.int64(labels.bits[b, n])
            continue
        due[count] = n
        count += 1
    for k in range(cars if stirred else count):
        n = k if stirred else due[k]
        some |= _label_approach(b, n, tick, tables)
    if some & FLAG.STOPPED != 0:
        _order_queues(b, tick, tables)
    elif some & MOTIONLESS != 0:
        for n in range(cars):
            labels.bits[b, n] = _with_stands(np.int64(labels.bits[b, n]))
    if some & NEEDS_OVERTAKING != 0 or tables.obstacles.base[b] >= 0:
        _label_overtaking(b, tick, tables)


@jit
def _order_queues(b: int, tick: int, tables: LabelTables) -> None:
    """Order the queues of trial b, excuse the cars behind them, and flag the cars that stand."""
    labels, memory, t = tables.labels, tables.memory, tables.roads
    rules, head, row, members = tables.rules[b], memory.head[b], memory.car[b], memory.member[b]
    bits, lanes = labels.bits[b], labels.lane[b]
    cars: int = tables.state.count[b]
    for n in range(cars):
        if bits[n] & FLAG.STOPPED == 0:
            continue
        v = lane_end(t, rules.net, lanes[n])
        if head[v].queue == n:
            queue = Queue(row, lanes, members, gather(n, row, members))
            keep_order(t, rules, queue, head[v].crossers == 0, tick)
            _flag_queue(n, row, bits)
    for n in range(cars):
        lane: int = lanes[n]
        if lane >= 0 and head[lane].lane == n:
            put_in_order(head[lane], row)
    for n in range(cars):
        lane = lanes[n]
        if lane < 0:
            bits[n] = _with_stands(np.int64(bits[n]))
        elif head[lane].lane == n:
            _excuse(n, rules.excuse, row, bits)
    for n in range(cars):
        if bits[n] & FLAG.STOPPED != 0:
            head[lane_end(t, rules.net, lanes[n])].queue = -1


@jit
def _label_overtaking(b: int, tick: int, tables: LabelTables) -> None:
    """Flag the cars of trial b that are blocked, overtake, are left and are hemmed in."""
    segments, head, row = tables.labels.segment[b], tables.memory.head[b], tables.memory.car[b]
    cars: int = tables.state.count[b]
    for n in range(cars):
        segment: int = segments[n]
        first = head[segment]
        row[n].next_on_segment = first.segment
        first.segment = n
    left = False
    for n in range(cars):
        left |= _label_blocked(b, n, tick, tables)
    for n in range(cars):
        segment = segments[n]
        head[segment].segment = -1
    if left:
        hem_in(b, tick, tables)


@jit_inline
def _label_approach(b: int, n: int, tick: int, tables: LabelTables) -> Any:
    """Flag whether car n approaches a crossing and has stopped there; give it a ticket and enter it in the queue.

    Also sets CLEAR, which depends on all cars' discs. Returns the car's flags so far, with LEFT if it will be left.

    Norm: docs/rules.md#clear, docs/rules.md#approach, docs/rules.md#stopped.
    """
    labels, memory = tables.labels, tables.memory
    rules, row, head = tables.rules[b], memory.car[b], memory.head[b]
    car = row[n]
    gap2 = car.gap2
    lane: int = labels.lane[b, n]
    crosses: int = labels.crosses[b, n]
    bits = np.int64(labels.bits[b, n]) & ~FLAG.CLEAR
    car.rank = -1
    left = FLAG.LEFT if car.reach > rules.left_set else 0
    if gap2 < 0.0:
        if bits & FLAG.IN_CROSSING != 0 and head[crosses].crossers == 1:
            bits |= FLAG.CLEAR
        bits &= ~FLAG.STOPPED
        labels.bits[b, n] = bits
        return bits | left
    v = lane_end(tables.roads, rules.net, lane)
    ahead = head[v]
    if ahead.crossers == (1 if crosses == v else 0):
        bits |= FLAG.CLEAR
    outside = gap2 >= rules.cross2
    if not outside:
        car.wait_since = -1
    if not outside or gap2 > rules.queue2:
        bits &= ~FLAG.STOPPED
    if outside and gap2 <= rules.stop2 and foremost(n, head[lane].lane, row, rules):
        if gap2 <= rules.approach2:
            bits |= FLAG.APPROACH
        if car.approach_since < 0:
            car.approach_since = tick
        ago = rules.stop_ticks
        if bits & FLAG.STOPPED == 0 and tick - car.approach_since >= ago:
            x, y = tables.state.x[b, n], tables.state.y[b, n]
            if moved2(b, n, tick, ago, x, y, memory) <= rules.stop_move2:
                bits |= FLAG.STOPPED
                _give_ticket(car, tick)
    else:
        car.approach_since = -1
    if bits & FLAG.STOPPED != 0:
        car.next_in_queue = ahead.queue
        ahead.queue = n
    labels.bits[b, n] = bits
    return bits | left


@jit_inline
def _give_ticket(car: CarMemory, tick: int) -> None:
    """Give a car that has stopped before a crossing the ticket of this tick."""
    car.ticket = tick
    car.first_since = -1
    if car.wait_since < 0:
        car.forfeits = 0
        car.wait_since = tick
    else:
        car.forfeits += 1


@jit_inline
def _flag_queue(first: int, cars: Rows[CarMemory], bits: Any) -> None:
    """Set the flags, `bits` (N,), of the cars in the ordered queue that begins with car `first`."""
    n = first
    while n >= 0:
        car = cars[n]
        flags = FLAG.FIRST if car.rank == 0 else FLAG.AHEAD
        flags |= FLAG.FORFEITED if car.forfeits > 0 else FLAG.EXCUSED
        bits[n] = np.int64(bits[n]) | flags
        n = car.next_in_queue


@jit_inline
def _excuse(first: int, far: float, cars: Rows[CarMemory], bits: Any) -> None:
    """Set EXCUSED for the cars of a lane up to `far` metres behind an excused one, and STANDS, in `bits` (N,).

    The cars of the lane are listed in order from car `first`, the foremost, on. A car without lane state is never
    excused.

    Norm: docs/rules.md#stands.
    """
    start = first
    n = first
    while n >= 0:
        car = cars[n]
        progress = car.progress
        while cars[start].progress - progress > far:
            start = cars[start].next_in_lane
        other = start
        while other != n and cars[other].progress > progress:
            if bits[other] & FLAG.EXCUSED != 0:
                bits[n] = np.int64(bits[n]) | FLAG.EXCUSED
                break
            other = cars[other].next_in_lane
        bits[n] = _with_stands(np.int64(bits[n]))
        n = car.next_in_lane


@jit_inline
def _with_stands(bits: Any) -> Any:
    """Return the flags `bits` of a car, with STANDS if it stands."""
    return bits | FLAG.STANDS if bits & FLAG.EXCUSED == 0 and bits & MOTIONLESS != 0 else bits


@jit
def _label_blocked(b: int, n: int, tick: int, tables: LabelTables) -> bool:
    """Flag whether the lane of car n is blocked, whether it overtakes and whether it is left; return the last.

    Norm: docs/rules.md#left, docs/rules.md#blocked, docs/rules.md#overtaking.
    """
    labels, t = tables.labels, tables.roads
    rules, car = tables.rules[b], tables.memory.car[b, n]
    lane = labels.lane[b, n]
    bits = np.int64(labels.bits[b, n])
    if lane < 0:
        labels.bits[b, n] = bits & ~(FLAG.OVERTAKING | FLAG.LEFT)
        return False
    blocked, beside = _cars_beside(b, n, lane, tables)
    if tables.obstacles.base[b] >= 0:
        place = lane_of(t, rules, b, lane)
        here = car.progress
        blocked = blocked or obstacle_narrows(
            tables.obstacles, place, here, here + rules.blocked_ahead, rules.free_needed
        )
        beside = beside or obstacle_narrows(
            tables.obstacles,
            place,
            here - rules.overtaking_behind,
            here + rules.overtaking_ahead,
            rules.free_needed,
        )
    if blocked:
        if bits & FLAG.OVERTAKING == 0:
            forget_region(tables.memory.kept[b, n // BLOCK], n)
        bits |= FLAG.BLOCKED | FLAG.OVERTAKING
    was_left = bits & FLAG.LEFT != 0
    if car.reach > rules.left_set:
        if bits & FLAG.LEFT == 0:
            car.left_since = tick
        bits |= FLAG.LEFT
    elif car.reach < rules.left_release:
        bits &= ~FLAG.LEFT
    ends = not beside and not blocked and not was_left and bits & FLAG.LEFT == 0
    if ends or bits & FLAG.ENTERED != 0 or labels.crosses[b, n] == lane_end(t, rules.net, lane):
        bits &= ~FLAG.OVERTAKING
    labels.bits[b, n] = bits
    return bits & FLAG.LEFT != 0


@jit_inline
def _cars_beside(b: int, n: int, lane: int, tables: LabelTables) -> tuple[bool, bool]:
    """Tell whether a standing car blocks the lane of car n, and whether one is so near that n still overtakes."""
    state, t, row = tables.state, tables.roads, tables.memory.car[b]
    rules = tables.rules[b]
    here = row[n].progress
    blocked = False
    beside = False
    other = tables.memory.head[b, lane // 2].segment
    while other >= 0:
        if other != n and tables.labels.bits[b, other] & FLAG.STANDS != 0:
            progress, low, high = place_in_lane(b, other, lane, state, t, rules)
            ahead = progress - here
            if narrows(low, high, rules.lane_width, rules.free_needed):
                blocked = blocked or 0.0 < ahead <= rules.blocked_ahead
                beside = beside or -rules.overtaking_behind <= ahead <= rules.overtaking_ahead
        other = row[other].next_on_segment
    return blocked, beside


@jit_rare
def hem_in(b: int, tick: int, tables: LabelTables) -> None:
    """Flag the cars of trial b that are hemmed in, in a frame in which some car is left; `tables` (LabelTables).

    Norm: docs/rules.md#hemmed.
    """
    labels, row = tables.labels, tables.memory.car[b]
    cars: int = tables.state.count[b]
    for n in range(cars):
        if np.int64(labels.bits[b, n]) & FLAG.STILL == 0:
            row[n].stirred = tick
    for n in range(cars):
        bits = np.int64(labels.bits[b, n])
        if bits & FLAG.LEFT != 0 and bits & FLAG.OVERTAKING != 0 and _is_hemmed(b, n, tables):
            labels.bits[b, n] = bits | FLAG.HEMMED


@jit
def _is_hemmed(b: int, n: int, tables: LabelTables) -> bool:
    """Tell whether near car n there is a car that was not still in some frame since n became left."""
    state, row, rules = tables.state, tables.memory.car[b], tables.rules[b]
    since = row[n].left_since
    for other in range(state.count[b]):
        if other != n and row[other].stirred >= since:
            dx = state.x[b, other] - state.x[b, n]
            dy = state.y[b, other] - state.y[b, n]
            if dx * dx + dy * dy <= rules.hem2:
                return True
    return False
