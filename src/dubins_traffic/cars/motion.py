"""Clip and move: one tick of a batch, with contacts over the whole interval in order of time.

Loops over trials and cars; the element functions are in `kernels.trig` and `kernels.boxes`.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from dubins_traffic.cars.clip_and_move import (
    TOGETHER,
    MotionConstants,
    any_near,
    clip,
    find_close,
    move,
    move_together,
)
from dubins_traffic.cars.near import FEW, Search, candidates, search_tables, widened_search
from dubins_traffic.cars.state import State
from dubins_traffic.cars.tables import CarTable, ObstacleTable, box_at, box_of
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.boxes import (
    NEVER,
    Box,
    Drive,
    box_contact,
    disc_contact,
    driven,
    held,
    separation,
)
from dubins_traffic.kernels.compile import jit, jit_inline, jit_rare
from dubins_traffic.kernels.records import Rows, record, table
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.kernels.trig import advance

PARTED = 0.01
"""Two bodies that touched count as touching until they are this far apart, metres."""
PARTNERS = 12
"""Most bodies that `Workspace.partner` can hold for a car."""
VACANT = -(2**62)
"""In `Workspace.partner`: no body."""


@record
class Meeting:
    """A contact in trial `b`: of `car` with `other`, a car or obstacle -1 - k, `time` seconds into the tick.

    (`px`, `py`) is its point, m, and (`nx`, `ny`) its normal, a unit vector from `car` to `other`. `closing` and
    `other_closing` are the speeds of the two bodies' points there toward each other, m/s; `moved` and `other_moved`
    tell whether each body moved in the tick, 0 or 1.
    """

    b: int
    car: int
    other: int
    time: float
    px: float
    py: float
    nx: float
    ny: float
    closing: float
    other_closing: float
    moved: int
    other_moved: int


class Workspace(Tables):
    """What `step` needs beside the state, allocated once.

    `partner` (B, N, PARTNERS): the bodies that a car has touched and is still close to, in the row of the car with the
    lower index, obstacle k as -1 - k, VACANT for none. `touching` (B,): number of such pairs. `search`: candidate pairs
    of one trial (P,); `when` (P,): their instants of contact, s. `until` (N,): when each car was fixed, s. `contact`
    (C,): the contacts, of which `found` (1,) are filled.
    """

    partner: Ints
    touching: Ints
    search: Search
    when: Floats
    until: Floats
    contact: Rows[Meeting]
    found: Ints

    def meetings(self) -> list[Meeting]:
        """Return the contacts found."""
        return [self.contact[k] for k in range(int(self.found[0]))]


def workspace(trials: int, cars: int) -> Workspace:
    """Return the workspace of a batch of `trials` x `cars`."""
    pairs = max(64, 8 * cars)
    return Workspace(
        partner=np.full((trials, cars, PARTNERS), VACANT, dtype=np.int64),
        touching=np.zeros(trials, dtype=np.int64),
        search=search_tables(cars, pairs),
        when=np.zeros(pairs),
        until=np.zeros(cars),
        contact=table(Meeting, max(1024, 2 * cars)),
        found=np.zeros(1, dtype=np.int64),
    )


@jit_rare
def forget_parted(state: State, cars: CarTable, obstacles: ObstacleTable, work: Workspace, b: int) -> None:
    """Forget the touching pairs of trial b whose bodies are PARTED or more apart by now."""
    for i in range(state.count[b]):
        for k in range(PARTNERS):
            other = work.partner[b, i, k]
            if other == VACANT:
                continue
            if _gap(state, cars, obstacles, b, i, other) >= PARTED:
                work.partner[b, i, k] = VACANT
                work.touching[b] -= 1


@jit
def _gap(state: State, cars: CarTable, obstacles: ObstacleTable, b: int, i: int, other: int) -> float:
    """Return the gap, metres, between car i and `other`, a car or obstacle -1 - k."""
    box = box_at(b, i, state, cars)
    if other >= 0:
        best, _, _, _, _ = separation(box, box_at(b, other, state, cars))
        return best
    best = NEVER
    for k in range(obstacles.off[b], obstacles.off[b + 1]):
        part_k = obstacles.parts[k]
        if part_k.owner == -1 - other:
            distance, _, _, _, _ = separation(box, box_of(part_k))
            best = min(best, distance)
    return best


def enlarged(work: Workspace) -> Workspace:
    """Return the workspace with more room for pairs."""
    search = widened_search(work.search)
    return work.replace(search=search, when=np.zeros(len(search.pair)))


class _Outcome(NamedTuple):
    """What `step_trial` and `step_part` return."""

    MOVED: int = 0
    """The trial has moved."""
    FULL: int = 1
    """The buffer of contacts is too small; the trial has not moved."""
    CROWDED: int = 2
    """The buffer of pairs is too small; the trial has not moved."""


OUTCOME: Final = _Outcome()


class Motion(Tables):
    """All tables that moving cars takes.

    During a tick `State.speed` and `State.yaw_rate` hold the clipped commands.
    """

    state: State
    obstacles: ObstacleTable
    cars: CarTable
    rows: MotionConstants
    work: Workspace


@jit
def step(first: int, dt: float, commands: Floats, motion: Motion) -> int:
    """Clip the commands in place and move the trials from `first` (index) on for one tick.

    Returns B, the number of trials, when all have moved. Otherwise it has stopped before a trial b: it returns b if the
    buffer of contacts is full (the caller empties it), or -1 - b if the buffer of pairs is too small (the caller
    enlarges it). The caller then calls it again from trial b on.
    """
    state, obstacles, r, work = motion.state, motion.obstacles, motion.rows, motion.work
    work.found[0] = 0
    trials, n = state.x.shape
    total = trials * n
    x, y, asked = state.x.reshape(total), state.y.reshape(total), commands.reshape(total, 2)
    speed, yaw = state.speed.reshape(total), state.yaw_rate.reshape(total)
    b = first
    while b < trials:
        last = b + r.alike[b]
        clip(r, b, asked, speed, yaw, b * n, last * n)
        if n <= FEW:
            find_close(r, b, x, y, n, b * n, last * n)
        begin = b
        for k in range(b, last):
            empty = obstacles.off[k] == obstacles.off[k + 1]
            if n <= FEW and empty and not _any_close(r, k - b, n):
                continue
            if work.found[0] + n > work.contact.shape[0]:
                _move_freely(begin, k, dt, motion)
                return k
            pairs = candidates(k, 2.0 * r.far[k], r.far[k], state, obstacles, work.search)
            if pairs > work.search.pair.shape[0]:
                _move_freely(begin, k, dt, motion)
                return -1 - k
            if pairs > 0:
                _move_freely(begin, k, dt, motion)
                _resolve(k, pairs, dt, motion)
                forget_parted(state, motion.cars, obstacles, work, k)
                begin = k + 1
        _move_freely(begin, last, dt, motion)
        b = last
    return trials


@jit
def step_trial(b: int, dt: float, least: float, commands: Floats, motion: Motion) -> int:
    """Clip the commands of trial b in place and move its cars for one tick; append their contacts to those found.

    `least` (m) is a lower bound on the distance between any two centres, 0 if none is known. Returns an `OUTCOME`.
    """
    state, work = motion.state, motion.work
    if work.found[0] + state.x.shape[1] > work.contact.shape[0]:
        return OUTCOME.FULL
    clip(motion.rows, b, commands[b], state.speed[b], state.yaw_rate[b], 0, state.count[b])
    return _move_trial(b, dt, least, motion)


@jit
def step_part(dt: float, arcs: Floats, stands: Ints, motion: Motion) -> int:
    """Move the cars of trial 0 on arcs for a part of a tick, `dt` (s) long; append their contacts to those found.

    `arcs` (1, N, 2), speed (m/s) and yaw rate (rad/s), are clipped in place. A car whose `stands` (N,) is not 0 has
    been fixed by an earlier contact and stands. Afterwards `Workspace.until` tells when each car was fixed. Returns an
    `OUTCOME`.
    """
    state, work = motion.state, motion.work
    if work.found[0] + state.x.shape[1] > work.contact.shape[0]:
        return OUTCOME.FULL
    clip(motion.rows, 0, arcs[0], state.speed[0], state.yaw_rate[0], 0, state.count[0])
    for n in range(state.count[0]):
        work.until[n] = NEVER
        if stands[n] != 0:
            state.speed[0, n] = 0.0
            state.yaw_rate[0, n] = 0.0
    return _move_trial(0, dt, 0.0, motion)


@jit_inline
def _move_trial(b: int, dt: float, least: float, motion: Motion) -> int:
    """Move the cars of trial b, whose commands are clipped; return an `OUTCOME`."""
    state, obstacles, r, work = motion.state, motion.obstacles, motion.rows, motion.work
    n = state.x.shape[1]
    cars_here = state.count[b]
    pairs = 0
    close = obstacles.off[b] != obstacles.off[b + 1]
    if not close and least <= 2.0 * r.far[b]:
        close = n > FEW or any_near(state.x[b], state.y[b], cars_here, r.near[b])
    if close:
        pairs = candidates(b, 2.0 * r.far[b], r.far[b], state, obstacles, work.search)
        if pairs > work.search.pair.shape[0]:
            return OUTCOME.CROWDED
    if pairs > 0:
        _resolve(b, pairs, dt, motion)
        forget_parted(state, motion.cars, obstacles, work, b)
        return OUTCOME.MOVED
    x, y, c, s, speed, yaw = state.x[b], state.y[b], state.c[b], state.s[b], state.speed[b], state.yaw_rate[b]
    if n % TOGETHER == 0:
        move_together(x, y, c, s, speed, yaw, dt)
    else:
        k = cars_here
        move(x[:k], y[:k], c[:k], s[:k], speed[:k], yaw[:k], dt)
    if work.touching[b] > 0:
        forget_parted(state, motion.cars, obstacles, work, b)
    return OUTCOME.MOVED


@jit
def _any_close(r: MotionConstants, trial: int, n: int) -> bool:
    close = 0
    for f in range(trial * n, trial * n + n):
        close += r.close[f]
    return close > 0


@jit
def _move_freely(first: int, last: int, dt: float, motion: Motion) -> None:
    """Move the trials `first` to `last` - 1, in which no two bodies can meet."""
    state, work = motion.state, motion.work
    trials, n = state.x.shape
    total = trials * n
    i, j = first * n, last * n
    move(
        state.x.reshape(total)[i:j], state.y.reshape(total)[i:j], state.c.reshape(total)[i:j],
        state.s.reshape(total)[i:j], state.speed.reshape(total)[i:j], state.yaw_rate.reshape(total)[i:j], dt,
    )  # fmt: skip
    for b in range(first, last):
        if work.touching[b] > 0:
            forget_parted(state, motion.cars, motion.obstacles, work, b)


@jit_inline
def _drive(b: int, n: int, until: float, state: State) -> Drive:
    return Drive(state.speed[b, n], state.yaw_rate[b, n], until)


@jit
def _meet(b: int, i: int, j: int, begin: float, dt: float, motion: Motion) -> float:
    """Return when, after `begin`, car i meets j, a car or obstacle part -1 - p, s; NEVER if not in this tick.

    Norm: docs/rules.md#collision.
    """
    state, cars, until = motion.state, motion.cars, motion.work.until
    one, drive = box_at(b, i, state, cars), _drive(b, i, until[i], state)
    if j < 0:
        other = box_of(motion.obstacles.parts[-1 - j])
        return box_contact(one, drive, other, Drive(0.0, 0.0, 0.0), begin, dt)
    other = box_at(b, j, state, cars)
    its = _drive(b, j, until[j], state)
    if one.half_length + one.half_width == 0.0:
        return disc_contact(one, drive, other, its, begin, dt)
    return box_contact(one, drive, other, its, begin, dt)


@jit_rare
def _resolve(b: int, pairs: int, dt: float, motion: Motion) -> None:
    """Move trial b, of which `pairs` pairs may meet.

    Contacts are taken in order of time. Each fixes its cars, for which later contacts are then computed anew. When
    there is none left, all cars move, each until it is fixed.
    """
    state, work = motion.state, motion.work
    until, when, pair = work.until, work.when, work.search.pair
    for n in range(state.count[b]):
        until[n] = NEVER
    for k in range(pairs):
        when[k] = _meet(b, pair[k].one, pair[k].other, 0.0, dt, motion)
    while True:
        first = -1
        for k in range(pairs):
            if when[k] < NEVER and (first < 0 or _before(work, k, first)):
                first = k
        if first < 0:
            break
        now = when[first]
        i = pair[first].one
        j = pair[first].other
        _note_contact(b, i, j, now, motion)
        until[i] = min(until[i], now)
        if j >= 0:
            until[j] = min(until[j], now)
        for k in range(pairs):
            m = pair[k].one
            o = pair[k].other
            if i in (m, o) or (j >= 0 and j in (m, o)):
                fixed = until[m] <= now and (o < 0 or until[o] <= now)
                when[k] = NEVER
                if not fixed:
                    when[k] = _meet(b, m, o, now, dt, motion)
    for n in range(state.count[b]):
        _move(b, n, until[n], dt, state)


@jit
def _move(b: int, n: int, until: float, dt: float, state: State) -> None:
    speed, yaw = state.speed[b, n], state.yaw_rate[b, n]
    x, y, c, s = advance(state.x[b, n], state.y[b, n], state.c[b, n], state.s[b, n], speed, yaw, min(until, dt))
    state.x[b, n] = x
    state.y[b, n] = y
    state.c[b, n] = c
    state.s[b, n] = s
    state.speed[b, n] = speed if until >= dt else 0.0
    state.yaw_rate[b, n] = yaw if until >= dt else 0.0


@jit
def _before(work: Workspace, k: int, m: int) -> bool:
    if work.when[k] != work.when[m]:
        return work.when[k] < work.when[m]
    one, other = work.search.pair[k], work.search.pair[m]
    return one.one < other.one if one.one != other.one else one.other < other.other


@jit_inline
def _moved(box: Box, drive: Drive) -> int:
    """Return 1 if a body moves, or is a rectangle that turns; else 0."""
    turned = drive.yaw_rate != 0.0 and box.half_length > 0.0
    return 1 if drive.speed != 0.0 or turned else 0


@jit
def _begin_touching(b: int, i: int, other: int, work: Workspace) -> bool:
    """Note that car i touches `other`, a car or obstacle -1 - k; tell whether the contact is a new one."""
    free = -1
    for k in range(PARTNERS):
        if work.partner[b, i, k] == other:
            return False
        if free < 0 and work.partner[b, i, k] == VACANT:
            free = k
    if free >= 0:
        work.partner[b, i, free] = other
        work.touching[b] += 1
    return True


@jit
def _note_contact(b: int, i: int, j: int, now: float, motion: Motion) -> None:
    """Append the contact of car i with j (a car, or obstacle part -1 - p) at `now`, unless they touched already."""
    state, cars, work = motion.state, motion.cars, motion.work
    other = j if j >= 0 else -1 - motion.obstacles.parts[-1 - j].owner
    if not _begin_touching(b, i, other, work):
        return
    drive = _drive(b, i, work.until[i], state)
    box = driven(box_at(b, i, state, cars), drive, now)
    its = Drive(0.0, 0.0, 0.0)
    if j >= 0:
        its = _drive(b, j, work.until[j], state)
        hit = driven(box_at(b, j, state, cars), its, now)
    else:
        hit = box_of(motion.obstacles.parts[-1 - j])
    _, nx, ny, px, py = separation(box, hit)
    number: int = work.found[0]
    row = work.contact[number]
    row.b = b
    row.car = i
    row.other = other
    row.time = now
    row.px = px
    row.py = py
    row.nx = nx
    row.ny = ny
    row.closing = _closing(box, drive, now, row)
    row.other_closing = -_closing(hit, its, now, row)
    row.moved = _moved(box, drive)
    row.other_moved = _moved(hit, its)
    work.found[0] += 1


@jit
def _closing(box: Box, drive: Drive, now: float, row: Meeting) -> float:
    """Return the speed along the normal of the point of a body that touches, m/s."""
    speed, yaw, _ = held(drive, now)
    turn = yaw if box.half_length > 0.0 else 0.0
    return row.nx * (speed * box.c - turn * (row.py - box.y)) + row.ny * (speed * box.s + turn * (row.px - box.x))
