"""Clip and move: one tick of a batch, with contacts over the whole interval in order of time.

Loops over trials and cars; the element functions are in `kernels.trig` and `kernels.boxes`.
"""

from __future__ import annotations

from dubins_traffic.cars.near import FEW, candidates
from dubins_traffic.cars.partners import PARTNERS, VACANT, Workspace, part
from dubins_traffic.cars.rows import TOGETHER, Rows, any_near, clip, look, move, move_fours
from dubins_traffic.cars.state import State
from dubins_traffic.cars.tables import CarTable, ObstacleTable
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.boxes import NEVER, box_contact, disc_contact, separation
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.trig import advance

MOVED, FULL, CROWDED = range(3)


@jit
def step(
    first: int, dt: float, commands: Floats, state: State, cars: CarTable, obstacles: ObstacleTable, r: Rows,
    work: Workspace,
) -> int:  # fmt: skip
    """Clip the commands in place and move trials `first`... for one tick of `dt` seconds.

    Parameters
    ----------
    first : int
        The first trial to move.
    dt : float
        Seconds.
    commands : array (B, N, 2)
        Speed and yaw rate of every car.
    state, cars, obstacles, r, work
        The batch.

    Returns
    -------
    int
        The number of trials B when all have moved, or the trial before which it stopped because the buffer of
        contacts is full, or -1 - b if the buffer of pairs is too small for trial b: empty or enlarge it and go on.
    """
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
            look(r, b, x, y, n, b * n, last * n)
        begin = b
        for k in range(b, last):
            empty = obstacles.off[k] == obstacles.off[k + 1]
            if n <= FEW and empty and not _any_close(r, k - b, n):
                continue
            if work.found[0] + n > work.contact.shape[0]:
                _pass_on(state, cars, obstacles, dt, work, begin, k)
                return k
            pairs = candidates(
                state, k, 2.0 * r.far[k], obstacles, r.far[k], work.pair, work.head, work.link, work.cell
            )
            if pairs > work.pair.shape[0]:
                _pass_on(state, cars, obstacles, dt, work, begin, k)
                return -1 - k
            if pairs > 0:
                _pass_on(state, cars, obstacles, dt, work, begin, k)
                _resolve(state, commands, cars, obstacles, dt, work, k, pairs)
                part(state, cars, obstacles, work, k)
                begin = k + 1
        _pass_on(state, cars, obstacles, dt, work, begin, last)
        b = last
    return trials


@jit
def step_trial(
    b: int,
    dt: float,
    least: float,
    state: State,
    commands: Floats,
    cars: CarTable,
    obstacles: ObstacleTable,
    r: Rows,
    work: Workspace,
) -> int:
    """Clip the commands of trial b in place and move it for one tick; add its contacts to those found.

    No two cars are nearer to each other than `least` (m), or nothing is known of that (0).
    Returns MOVED, or what is too small, FULL for the buffer of contacts or CROWDED for that of pairs: then nothing
    has moved.
    """
    n = state.x.shape[1]
    if work.found[0] + n > work.contact.shape[0]:
        return FULL
    cars_here = state.count[b]
    clip(r, b, commands[b], state.speed[b], state.yaw_rate[b], 0, cars_here)
    pairs = 0
    close = obstacles.off[b] != obstacles.off[b + 1]
    if not close and least <= 2.0 * r.far[b]:
        close = n > FEW or any_near(state.x[b], state.y[b], cars_here, r.near[b])
    if close:
        pairs = candidates(
            state, b, 2.0 * r.far[b], obstacles, r.far[b], work.pair, work.head, work.link, work.cell
        )
        if pairs > work.pair.shape[0]:
            return CROWDED
    if pairs > 0:
        _resolve(state, commands, cars, obstacles, dt, work, b, pairs)
        part(state, cars, obstacles, work, b)
        return MOVED
    if n % TOGETHER == 0:
        move_fours(state.x[b], state.y[b], state.c[b], state.s[b], state.speed[b], state.yaw_rate[b], dt)
    else:
        move(
            state.x[b], state.y[b], state.c[b], state.s[b], state.speed[b], state.yaw_rate[b], dt, 0, cars_here
        )  # fmt: skip
    if work.touching[b] > 0:
        part(state, cars, obstacles, work, b)
    return MOVED


@jit
def _any_close(r: Rows, trial: int, n: int) -> bool:
    close = 0
    for f in range(trial * n, trial * n + n):
        close += r.close[f]
    return close > 0


@jit
def _pass_on(
    state: State, cars: CarTable, obstacles: ObstacleTable, dt: float, work: Workspace, first: int, last: int
) -> None:
    """Move the trials first..last - 1, in which nothing can meet."""
    trials, n = state.x.shape
    total = trials * n
    move(
        state.x.reshape(total), state.y.reshape(total), state.c.reshape(total), state.s.reshape(total),
        state.speed.reshape(total), state.yaw_rate.reshape(total), dt, first * n, last * n,
    )  # fmt: skip
    for b in range(first, last):
        if work.touching[b] > 0:
            part(state, cars, obstacles, work, b)


@jit
def _move(state: State, b: int, i: int, speed: float, yaw: float, until: float, dt: float) -> None:
    x, y, c, s = advance(
        state.x[b, i], state.y[b, i], state.c[b, i], state.s[b, i], speed, yaw, min(until, dt)
    )
    state.x[b, i] = x
    state.y[b, i] = y
    state.c[b, i] = c
    state.s[b, i] = s
    state.speed[b, i] = speed if until >= dt else 0.0
    state.yaw_rate[b, i] = yaw if until >= dt else 0.0


@jit
def _meet(
    state: State,
    commands: Floats,
    cars: CarTable,
    obstacles: ObstacleTable,
    until: Floats,
    b: int,
    i: int,
    j: int,
    begin: float,
    dt: float,
) -> float:
    """Return when car i meets j, a car or obstacle part -1 - p, after `begin`; NEVER if not in this tick."""
    a, h, r = cars.half_length[b], cars.half_width[b], cars.rounding[b]
    x, y, c, s = state.x[b, i], state.y[b, i], state.c[b, i], state.s[b, i]
    u, w = commands[b, i, 0], commands[b, i, 1]
    if j < 0:
        p = obstacles.part[-1 - j]
        return box_contact(
            x, y, c, s, u, w, until[i], a, h, r,
            p[0], p[1], p[2], p[3], 0.0, 0.0, 0.0, p[4], p[5], p[6], begin, dt,
        )  # fmt: skip
    if a + h == 0.0:
        return disc_contact(
            x, y, c, s, u, w, until[i],
            state.x[b, j], state.y[b, j], state.c[b, j], state.s[b, j], commands[b, j, 0], commands[b, j, 1],
            until[j], 2.0 * r, begin, dt,
        )  # fmt: skip
    return box_contact(
        x, y, c, s, u, w, until[i], a, h, r,
        state.x[b, j], state.y[b, j], state.c[b, j], state.s[b, j], commands[b, j, 0], commands[b, j, 1],
        until[j], a, h, r, begin, dt,
    )  # fmt: skip


@jit
def _resolve(
    state: State,
    commands: Floats,
    cars: CarTable,
    obstacles: ObstacleTable,
    dt: float,
    work: Workspace,
    b: int,
    pairs: int,
) -> None:
    """Move trial b with its candidate pairs: fix both cars at the earliest contact, search on, then move all."""
    until = work.until
    for i in range(state.count[b]):
        until[i] = NEVER
    for k in range(pairs):
        work.when[k] = _meet(
            state, commands, cars, obstacles, until, b, work.pair[k, 0], work.pair[k, 1], 0.0, dt
        )
    while True:
        first = -1
        for k in range(pairs):
            if work.when[k] < NEVER and (first < 0 or _before(work, k, first)):
                first = k
        if first < 0:
            break
        now = work.when[first]
        i = work.pair[first, 0]
        j = work.pair[first, 1]
        _note(state, commands, cars, obstacles, work, b, i, j, now)
        until[i] = min(until[i], now)
        if j >= 0:
            until[j] = min(until[j], now)
        for k in range(pairs):
            m = work.pair[k, 0]
            o = work.pair[k, 1]
            if i in (m, o) or (j >= 0 and j in (m, o)):
                fixed = until[m] <= now and (o < 0 or until[o] <= now)
                work.when[k] = NEVER
                if not fixed:
                    work.when[k] = _meet(state, commands, cars, obstacles, until, b, m, o, now, dt)
    for i in range(state.count[b]):
        _move(state, b, i, commands[b, i, 0], commands[b, i, 1], until[i], dt)


@jit
def _before(work: Workspace, k: int, m: int) -> bool:
    if work.when[k] != work.when[m]:
        return work.when[k] < work.when[m]
    if work.pair[k, 0] != work.pair[m, 0]:
        return work.pair[k, 0] < work.pair[m, 0]
    return work.pair[k, 1] < work.pair[m, 1]


@jit
def _pose(
    state: State, commands: Floats, until: Floats, b: int, i: int, now: float
) -> tuple[float, float, float, float]:
    return advance(
        state.x[b, i], state.y[b, i], state.c[b, i], state.s[b, i],
        commands[b, i, 0], commands[b, i, 1], min(now, until[i]),
    )  # fmt: skip


@jit
def _moved(cars: CarTable, b: int, speed: float, yaw: float) -> float:
    turned = yaw != 0.0 and cars.half_length[b] > 0.0
    return 1.0 if speed != 0.0 or turned else 0.0


@jit
def _note(
    state: State,
    commands: Floats,
    cars: CarTable,
    obstacles: ObstacleTable,
    work: Workspace,
    b: int,
    i: int,
    j: int,
    now: float,
) -> None:
    """Write down the contact of car i with j (a car, or obstacle part -1 - p), unless they touched already."""
    other = j if j >= 0 else -1 - obstacles.owner[-1 - j]
    free = -1
    for k in range(PARTNERS):
        if work.partner[b, i, k] == other:
            return
        if free < 0 and work.partner[b, i, k] == VACANT:
            free = k
    if free >= 0:
        work.partner[b, i, free] = other
        work.touching[b] += 1
    a, h, r = cars.half_length[b], cars.half_width[b], cars.rounding[b]
    x0, y0, c0, s0 = _pose(state, commands, work.until, b, i, now)
    v0, w0 = (commands[b, i, 0], commands[b, i, 1]) if now < work.until[i] else (0.0, 0.0)
    if j >= 0:
        x1, y1, c1, s1 = _pose(state, commands, work.until, b, j, now)
        v1, w1 = (commands[b, j, 0], commands[b, j, 1]) if now < work.until[j] else (0.0, 0.0)
        _, nx, ny, px, py = separation(x0, y0, c0, s0, a, h, r, x1, y1, c1, s1, a, h, r)
        moved = _moved(cars, b, commands[b, j, 0], commands[b, j, 1])
    else:
        p = obstacles.part[-1 - j]
        x1, y1, c1, s1, v1, w1, moved = p[0], p[1], p[2], p[3], 0.0, 0.0, 0.0
        _, nx, ny, px, py = separation(x0, y0, c0, s0, a, h, r, x1, y1, c1, s1, p[4], p[5], p[6])
    row = work.contact[work.found[0]]
    row[0], row[1], row[2], row[3] = b, i, other, now
    row[4], row[5], row[6], row[7] = px, py, nx, ny
    turn0 = w0 if a > 0.0 else 0.0
    turn1 = w1 if a > 0.0 else 0.0
    row[8] = nx * (v0 * c0 - turn0 * (py - y0)) + ny * (v0 * s0 + turn0 * (px - x0))
    row[9] = -(nx * (v1 * c1 - turn1 * (py - y1)) + ny * (v1 * s1 + turn1 * (px - x1)))
    row[10] = _moved(cars, b, commands[b, i, 0], commands[b, i, 1])
    row[11] = moved
    work.found[0] += 1
