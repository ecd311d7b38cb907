"""Judges one frame of a batch: which rules are broken in it, by which car, since when, where (compiled)."""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from dubins_traffic.cars.near import list_near
from dubins_traffic.cars.state import EGO, Labels, State
from dubins_traffic.kernels.arrays import INFINITE, Bits
from dubins_traffic.kernels.compile import jit, jit_inline, jit_look, jit_rare
from dubins_traffic.roads.lookup import distance2, lane_end
from dubins_traffic.rules.breach_log import NEVER_DUE, BreachLog, EntryMargins, JudgedCar, RefereeTables
from dubins_traffic.rules.breaches import judge_entry, judge_lane, judge_road, judge_turn
from dubins_traffic.rules.duties import judge_agent, judge_goals
from dubins_traffic.rules.frame import label_trial
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.rules.shape import distance2_to_body
from dubins_traffic.rules.tables import GRAIN, LabelTables, Memory, TrialRules

ENTERS_CROSSING = FLAG.ENTERED | FLAG.IN_CROSSING


@jit
def judge_frame(tick: int, tables: RefereeTables) -> None:
    """Append the breaches that begin in frame `tick`, which has been labelled, to the log."""
    for b in range(tables.state.count.shape[0]):
        if tables.terms[b].judged != 0:
            judge_trial(b, tick, tables)


@jit
def judge_trial(b: int, tick: int, tables: RefereeTables) -> None:
    """Append the breaches of trial b that begin in frame `tick`, which has been labelled, to the log."""
    labels, log = tables.labels, tables.log
    first = log.filled[0]
    count = _list_due(b, tick, tables.state.count[b], labels, tables.memory, log)
    arrived = tick == log.goal_due[b]
    for i in range(count):
        n = log.look[i]
        car = log.car[b, n]
        arrived |= car.at != labels.at[b, n]
        if car.crosses != labels.crosses[b, n]:
            car.in_since = tick
            car.came_by = car.lane
            car.been_out = 0
    for i in range(count):
        _judge_car(b, log.look[i], tick, tables)
    if arrived:
        judge_goals(b, tick, tables)
    for k in range(first, log.filled[0]):
        log.row[k].trial = b
    for i in range(count):
        n = log.look[i]
        car = log.car[b, n]
        car.bits = labels.bits[b, n]
        car.lane = labels.lane[b, n]
        car.crosses = labels.crosses[b, n]
        car.at = labels.at[b, n]
        kept = tables.memory.car[b, n]
        car.ticket, car.approach_since = kept.ticket, kept.approach_since


@jit_inline
def _list_due(b: int, tick: int, cars: int, labels: Labels, memory: Memory, log: BreachLog) -> int:
    """List the cars to be judged in this frame in `log.look`; return how many there are.

    These are cars whose labels have changed, that have got a ticket, or whose `due` has come; and all cars in discs if
    the ego's body has come into a disc or left one.
    """
    look, row = log.look, log.car[b]
    joins = labels.crosses[b, EGO] != row[EGO].crosses
    count = 0
    for n in range(cars):
        car = row[n]
        joined = joins & (labels.crosses[b, n] >= 0)
        look[count] = n
        count += 0 if _is_as_before(b, n, tick, joined, car, labels, memory) else 1
    return count


@jit_look
def _is_as_before(b: int, n: int, tick: int, joined: bool, car: JudgedCar, labels: Labels, memory: Memory) -> bool:
    """Tell whether a car need not be judged: no label has changed, it has no new ticket, it is not due nor `joined`.

    `joined` tells whether the car is in a disc and the ego has come into a disc or left one.
    """
    other = (np.int64(labels.bits[b, n]) ^ car.bits) | (labels.lane[b, n] ^ car.lane)
    other |= (labels.crosses[b, n] ^ car.crosses) | (labels.at[b, n] ^ car.at)
    ticket = memory.car[b, n].ticket == tick
    return not ((other != 0) | ticket | (tick >= car.due) | joined)


@jit_inline
def _judge_car(b: int, n: int, tick: int, tables: RefereeTables) -> None:
    """Judge car n, and set `JudgedCar.due`, the tick in which it has to be judged again."""
    labels, log, rules = tables.labels, tables.log, tables.rules[b]
    car = log.car[b, n]
    bits = np.int64(labels.bits[b, n])
    lane = labels.lane[b, n]
    v = labels.crosses[b, n]
    due = tick + 1 if bits & FLAG.LEFT != 0 else NEVER_DUE
    if _surely_left(bits, tables.memory.car[b, n].reach, car.left_since >= 0, rules):
        judge_lane(car, bits, lane, tick, tables.terms[b], log)
    else:
        car.left_since = -1
        car.free_since = -1
        car.unblocked_since = -1
    judge_turn(car, bits, lane, tick, log)
    if bits & ENTERS_CROSSING == ENTERS_CROSSING:
        stopped = False
        if car.bits & FLAG.STOPPED != 0:
            stopped = lane_end(tables.roads, rules.net, car.lane) == v
        _judge_entry(b, n, tick, v, stopped, tables)
    on = bits & FLAG.ON_ROAD != 0
    if not on and car.off_road == -1 and _by_the_road(b, n, tables):
        on, due = True, tick + 1
    judge_road(car, on, lane, tick, log)
    if n != EGO:
        due = min(due, judge_agent(b, n, tick, tables))
        if car.at != labels.at[b, n]:
            car.at_since = tick
    car.due = due


@jit_inline
def _surely_left(bits: Any, reach: float, was: bool, rules: TrialRules) -> bool:
    """Tell whether a car is left by limits eased by GRAIN in its favour; `was`: it was left in the frame before."""
    limit = rules.left_release if was else rules.left_set
    return bits & FLAG.LEFT != 0 and (reach >= limit + GRAIN if was else reach > limit + GRAIN)


@jit_rare
def _by_the_road(b: int, n: int, tables: RefereeTables) -> bool:
    """Tell whether car n is off the road by no more than GRAIN."""
    roads, net = tables.roads, tables.rules[b].net
    far = roads.half_width[net] + GRAIN
    x, y = float(tables.state.x[b, n]), float(tables.state.y[b, n])
    return distance2(roads, net, int(tables.labels.segment[b, n]), x, y) <= far * far


@jit
def _judge_entry(b: int, n: int, tick: int, v: int, stopped: bool, tables: RefereeTables) -> None:
    """Judge rule 3 for car n, which enters crossing v; of the ego, also measure the margins."""
    roads, spacing = tables.roads, tables.spacing
    row: int = roads.vert_off[tables.rules[b].net] + v
    far = tables.terms[b].lone + 2.0 * spacing.drift[b]
    x, y = roads.vertex[row].x, roads.vertex[row].y
    count = list_near(tables.state, b, tick, x, y, far, spacing)
    judge_entry(b, n, tick, v, stopped, count, tables)
    if n == EGO:
        measure_entry(b, tick, v, stopped, count, tables)


@jit
def judge_frames(
    first: int, begin: int, room: int, poses: State, bits: Bits, labelling: LabelTables, judging: RefereeTables
) -> int:  # fmt: skip
    """Label and judge frames of one trial from row `begin` (row) on; return the row after the last.

    Row f of `poses` (F, N) is frame `first` (tick) + f. The flags found are written to `bits` (F, N). It ends early
    when the log may have too few rows for another frame, which needs `room` (rows).
    """
    state, log, flags = judging.state, judging.log, judging.labels.bits
    for f in range(begin, bits.shape[0]):
        if log.filled[0] + room > log.row.shape[0]:
            return f
        for n in range(bits.shape[1]):
            state.x[0, n] = poses.x[f, n]
            state.y[0, n] = poses.y[f, n]
            state.c[0, n] = poses.c[f, n]
            state.s[0, n] = poses.s[f, n]
        label_trial(0, first + f, labelling)
        if judging.terms[0].judged != 0:
            judge_trial(0, first + f, judging)
        for n in range(bits.shape[1]):
            bits[f, n] = flags[0, n]
    return bits.shape[0]


LEAST = 1e-6
"""Least absolute value of the margin of clearance, metres.

That margin is measured one frame after the one that is judged, when its sign may have changed: the sign is taken from
the judgement, and the value is then this.
"""


@jit_rare
def measure_entry(b: int, tick: int, v: int, stopped: bool, count: int, tables: RefereeTables) -> None:
    """Lower the ego's least margins of rule 3 to those of its entry into crossing v of trial b in this frame.

    `stopped` (whether), `count` (number) and `tables` (all rows of the referee) are those of
    `rules.breaches.judge_entry`; the signs follow its judgement.
    """
    log = tables.log
    entry = log.entry[b]
    ego = log.car[b, EGO]
    if stopped:
        entry.stop = min(entry.stop, max(1.0, float(tick - ego.ticket)))
        lead = _lead(b, v, tables)
        entry.order = min(entry.order, min(lead, -1.0) if ego.bits & FLAG.AHEAD != 0 else max(lead, 1.0))
    else:
        run = tick - 1 - ego.approach_since if ego.approach_since >= 0 else 0
        entry.stop = min(entry.stop, -max(1.0, float(tables.rules[b].stop_ticks - run)))
    _measure_clearance(b, v, count, entry, tables)


@jit
def _lead(b: int, v: int, tables: RefereeTables) -> float:
    """Return how many ticks after the ego's ticket the next ticket at v was taken; negative: before it."""
    log, net = tables.log, tables.rules[b].net
    ticket = log.car[b, EGO].ticket
    lead = INFINITE
    for k in range(1, tables.state.count[b]):
        other = log.car[b, k]
        if other.bits & FLAG.STOPPED != 0 and other.lane >= 0 and lane_end(tables.roads, net, other.lane) == v:
            lead = min(lead, float(other.ticket - ticket))
    return lead


@jit
def _measure_clearance(b: int, v: int, count: int, margins: EntryMargins, tables: RefereeTables) -> None:
    log, state, roads, rules = tables.log, tables.state, tables.roads, tables.rules[b]
    vertex = roads.vertex[int(roads.vert_off[rules.net]) + v]
    broken = False
    nearest = INFINITE
    for i in range(count):
        k = tables.spacing.near[i]
        if k == EGO:
            continue
        broken = broken or log.car[b, k].crosses == v
        square = distance2_to_body(
            vertex.x, vertex.y, state.x[b, k], state.y[b, k], state.c[b, k], state.s[b, k],
            rules.half_length, rules.half_width,
        )  # fmt: skip
        nearest = min(nearest, sqrt(square) - rules.rounding - rules.radius)
    margins.clear = min(margins.clear, min(nearest, -LEAST) if broken else max(nearest, LEAST))
