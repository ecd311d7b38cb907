"""Judges one car in one frame (compiled): runs, and the breaches of rules 1 to 3, E3 and E6."""

from __future__ import annotations

from typing import Any

from dubins_traffic.cars.state import EGO
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.compile import jit, jit_inline, jit_rare
from dubins_traffic.kernels.records import Rows
from dubins_traffic.rules.breach_log import (
    NEVER_DUE,
    RULE,
    BreachLog,
    JudgedCar,
    RefereeParameters,
    RefereeTables,
)
from dubins_traffic.rules.propositions import FLAG

FIRST_AND_CLEAR = FLAG.FIRST | FLAG.CLEAR


@jit_rare
def add(log: BreachLog, car: JudgedCar, rule: int, tick: int, since: int, vertex: int, lane: int) -> None:
    """Append a breach of `rule`, a number in `RULES`, in frame `tick` to the log; the trial is left to fill in."""
    k: int = log.filled[0]
    row = log.row[k]
    row.rule = rule
    row.car = car.number
    row.tick = tick
    row.since = since
    row.vertex = vertex
    row.lane = lane
    log.filled[0] = k + 1


@jit_inline
def run(holds: bool, tick: int, since: int) -> int:
    """Return the first tick of a run after frame `tick`, in which its condition `holds` (bool) or not; -1 for no run.

    Before that frame the run had begun in `since`.
    """
    if not holds:
        return -1
    return since if since >= 0 else tick


@jit_inline
def lasted(tick: int, since: int) -> int:
    """Return the length in ticks of a run that began in `since`, -1 if there is none."""
    return tick - since if since >= 0 else -1


@jit_inline
def when_due(tick: int, since: int, ago: int) -> int:
    """Return the later tick in which a run that began in `since` will be `ago` ticks long, `NEVER_DUE` if none."""
    return since + ago if since >= 0 and since + ago > tick else NEVER_DUE


@jit_rare
def judge_lane(car: JudgedCar, bits: Any, lane: int, tick: int, terms: RefereeParameters, log: BreachLog) -> None:
    """Judge rule 2: a car is left only while overtaking, and for at most `left_time` unless it is hemmed in.

    `bits` (FLAG) and `lane` are those of the car in this frame.

    Norm: docs/rules.md#2.left, docs/rules.md#2.return.
    """
    car.left_since = run(bits & FLAG.LEFT != 0, tick, car.left_since)
    car.free_since = run(bits & (FLAG.LEFT | FLAG.HEMMED) == FLAG.LEFT, tick, car.free_since)
    car.unblocked_since = run(bits & (FLAG.LEFT | FLAG.OVERTAKING) == FLAG.LEFT, tick, car.unblocked_since)
    if lasted(tick, car.unblocked_since) == 0:
        add(log, car, RULE.LEFT_UNBLOCKED, tick, car.left_since, -1, lane)
    if lasted(tick, car.free_since) == terms.return_ticks:
        add(log, car, RULE.RETURN, tick, car.free_since, -1, lane)


@jit
def judge_entry(b: int, n: int, tick: int, v: int, stopped: bool, count: int, tables: RefereeTables) -> None:
    """Judge rule 3 for car n of trial b, which enters crossing v in this frame, by the frame before.

    The first `count` cars of `spacing.near` are all that may have been in the crossing then.

    Norm: docs/rules.md#3.stop, docs/rules.md#3.order, docs/rules.md#3.clear.
    """
    log, near = tables.log, tables.spacing.near
    car = log.car[b, n]
    if not stopped:
        add(log, car, RULE.STOP, tick, tick, v, car.lane)
    elif car.bits & FLAG.AHEAD != 0:
        add(log, car, RULE.ORDER, tick, tick, v, car.lane)
    for i in range(count):
        k = near[i]
        if k != n and log.car[b, k].crosses == v:
            add(log, car, RULE.CLEARANCE, tick, tick, v, car.lane)
            return


@jit_inline
def judge_turn(car: JudgedCar, bits: Any, lane: int, tick: int, log: BreachLog) -> None:
    """Judge rule 2: a car turns round, or backs up so far, in discs only; `bits` (FLAG) are those in this frame.

    Norm: docs/rules.md#2.turn.
    """
    if bits & FLAG.TURNED != 0:
        add(log, car, RULE.TURN, tick, tick, -1, lane)


@jit_inline
def judge_road(car: JudgedCar, on: bool, lane: int, tick: int, log: BreachLog) -> None:
    """Judge rule 1 for the ego, E1 for an e-agent: after its first frame on the road a car stays there.

    `on` (bool) tells whether it is there in this frame.

    Norm: docs/rules.md#1.road.
    """
    if on:
        car.off_road = -1
    elif car.off_road == -1:
        car.off_road = tick
        add(log, car, RULE.ROAD, tick, tick, -1, lane)


@jit
def judge_queue(b: int, n: int, tick: int, v: int, tables: RefereeTables) -> None:
    """Judge E3 for car n of trial b, which has stopped at v.

    A car that is first at a clear crossing enters it in time, and takes few tickets.

    Norm: docs/rules.md#E3.enter, docs/rules.md#E3.tickets.
    """
    log, terms, kept = tables.log, tables.terms[b], tables.memory.car[b, n]
    car, lane = log.car[b, n], tables.labels.lane[b, n]
    car.first_since = run(tables.labels.bits[b, n] & FIRST_AND_CLEAR == FIRST_AND_CLEAR, tick, car.first_since)
    if lasted(tick, car.first_since) == terms.enter_ticks:
        add(log, car, RULE.ENTER, tick, car.first_since, v, lane)
    if kept.forfeits == terms.most_tickets + 1 and kept.ticket == tick:
        add(log, car, RULE.TICKETS, tick, kept.wait_since, v, lane)


@jit_inline
def at_goal(goal: int, count: int, at: Ints, cars: Rows[JudgedCar]) -> int:
    """Return the e-agent that has been at a goal longest (E6), -1 if none is there.

    `at` (N,) are the discs that hold the centres of `cars` (N,); only the first `count` cars exist.

    Norm: docs/rules.md#free.
    """
    who = -1
    for n in range(EGO + 1, count):
        if at[n] == goal and (who < 0 or cars[n].at_since < cars[who].at_since):
            who = n
    return who
