"""The common case of a tick, in loops without branches over the cars of several trials at once.

Arrays are rows over all cars of a batch, trial after trial (a view of the (B, N) arrays), so that the compiler
can work on many cars with one instruction. Nothing here knows contacts: `cars.motion` calls `move` for the trials
in which no two bodies can meet during the tick, which is nearly all of them.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from dubins_traffic.cars.near import FEW
from dubins_traffic.cars.tables import CarTable
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.compile import jit, jit_inline
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.kernels.trig import advance

RUN = 32
"""Trials that are looked at together: their rows fit the processor's nearest memory."""
TOGETHER = 4
"""Cars of one trial that are moved at once, if it has a multiple of as many places."""


class Rows(Tables):
    """Constants of a batch, one value per trial (B,), except `alike`, `mask` and `close`.

    `low`, `high`: bounds on the speed; `most`, `slack`, `curvature`: |yaw| <= min(most, slack + curvature |speed|);
    `far`: how far from its centre a car may reach in one tick; `near`: square of the distance of the centres within
    which two cars may then meet. `alike` (B,): how many trials
    from this one on have the same constants, at most RUN; `mask` (N, RUN * N): 1 where the car o places on is of
    the same trial, else 0; `close` (RUN * N,): scratch; both without columns where there are more than FEW cars.
    """

    low: Floats
    high: Floats
    most: Floats
    slack: Floats
    curvature: Floats
    far: Floats
    near: Floats
    alike: Ints
    mask: Floats
    close: Ints


def rows(cars: CarTable, n: int, dt: float) -> Rows:
    """Return the constants of a batch with `n` places for cars per trial and ticks of `dt` seconds."""
    free = cars.turning_radius == 0.0
    fastest = np.maximum(np.abs(cars.speed_low), np.abs(cars.speed_high))
    far = cars.reach + fastest * dt + 1e-8
    slack = np.where(free, cars.yaw_rate, 0.0)
    curvature = np.where(free, 0.0, 1.0 / np.where(free, 1.0, cars.turning_radius))
    near = 4.0 * far * far
    constants = (cars.speed_low, cars.speed_high, cars.yaw_rate, slack, curvature, far, near)
    mask = _mask(n)
    close = np.zeros(mask.shape[1], dtype=np.int64)
    return Rows(*constants, alike=_alike(np.stack(constants)), mask=mask, close=close)


@lru_cache(maxsize=FEW)
def _mask(n: int) -> Floats:
    """Return `Rows.mask`, which is only read, for `n` places; batches share it."""
    place = np.arange(RUN * n if n <= FEW else 0) % n
    return np.array([place + shift < n for shift in range(n)], dtype=np.float64)


def _alike(columns: Floats) -> Ints:
    alike = [1]
    for same in reversed((columns[:, :-1] == columns[:, 1:]).all(axis=0).tolist()):
        alike.append(min(alike[-1] + 1, RUN) if same else 1)
    return np.array(alike[::-1], dtype=np.int64)


@jit
def clip(r: Rows, b: int, commands: Floats, speed: Floats, yaw: Floats, first: int, last: int) -> None:
    """Clip the commands (B * N, 2) of the cars `first` (index) to before `last` (index), all like those of trial b.

    In place; the speed is clipped first. Both also go to `speed` (B * N,), m/s, and `yaw` (B * N,), rad/s.
    """
    low, high, most, slack, curvature = r.low[b], r.high[b], r.most[b], r.slack[b], r.curvature[b]
    own, speed, yaw = commands[first:last], speed[first:last], yaw[first:last]
    for f in range(last - first):
        u = min(max(own[f, 0], low), high)
        bound = min(most, slack + curvature * abs(u))
        w = min(max(own[f, 1], -bound), bound)
        own[f, 0] = u
        own[f, 1] = w
        speed[f] = u
        yaw[f] = w


@jit
def look(r: Rows, b: int, x: Floats, y: Floats, n: int, first: int, last: int) -> int:
    """Set `Rows.close` for each car that may meet a later one of its trial; return how many.

    The cars are `first` (index) to before `last` (index) of `x` (B * N,) and `y` (B * N,), metres; n to a trial.
    """
    count = last - first
    close = r.close[:count]
    near = r.near[b]
    for f in range(count):
        close[f] = 0
    for shift in range(1, n):
        mask = r.mask[shift, : count - shift]
        x0, y0 = x[first : last - shift], y[first : last - shift]
        x1, y1 = x[first + shift : last], y[first + shift : last]
        for f in range(count - shift):
            dx = x1[f] - x0[f]
            dy = y1[f] - y0[f]
            close[f] |= 1 if dx * dx + dy * dy < near * mask[f] else 0
    total = 0
    for f in range(count):
        total += close[f]
    return total


@jit
def any_near(x: Floats, y: Floats, cars: int, near: float) -> bool:
    """Tell whether any two of the first `cars` (count) cars are nearer to each other than the root of `near` (m^2).

    `x` (N,) and `y` (N,) are their centres, metres.
    """
    close = 0
    for i in range(cars - 1):
        for j in range(i + 1, cars):
            dx = x[j] - x[i]
            dy = y[j] - y[i]
            close |= 1 if dx * dx + dy * dy < near else 0
    return close != 0


@jit
def move(x: Floats, y: Floats, c: Floats, s: Floats, speed: Floats, yaw: Floats, dt: float) -> None:
    """Move cars along their arcs for `dt` seconds.

    `x` (K,) and `y` (K,) are centres, metres; `c` (K,) and `s` (K,) headings; `speed` (K,), m/s, and `yaw` (K,), rad/s,
    what they hold.
    """
    for f in range(x.shape[0]):
        x[f], y[f], c[f], s[f] = advance(x[f], y[f], c[f], s[f], speed[f], yaw[f], dt)


@jit
def move_fours(x: Floats, y: Floats, c: Floats, s: Floats, speed: Floats, yaw: Floats, dt: float) -> None:
    """Do as `move`, for all places of one trial: `x` (N,), `y` (N,), `c` (N,), `s` (N,), `speed` (N,), `yaw` (N,).

    Four cars are written out, which become one instruction each; a loop would take more at a time than a trial has.
    """
    for f in range(0, x.shape[0], TOGETHER):
        x0, y0, c0, s0 = advance(x[f], y[f], c[f], s[f], speed[f], yaw[f], dt)
        g = f + 1
        x1, y1, c1, s1 = advance(x[g], y[g], c[g], s[g], speed[g], yaw[g], dt)
        h = f + 2
        x2, y2, c2, s2 = advance(x[h], y[h], c[h], s[h], speed[h], yaw[h], dt)
        i = f + 3
        x3, y3, c3, s3 = advance(x[i], y[i], c[i], s[i], speed[i], yaw[i], dt)
        x[f], x[g], x[h], x[i] = x0, x1, x2, x3
        y[f], y[g], y[h], y[i] = y0, y1, y2, y3
        c[f], c[g], c[h], c[i] = c0, c1, c2, c3
        s[f], s[g], s[h], s[i] = s0, s1, s2, s3


@jit_inline
def copy_together(source: Floats, n: int, target: Floats, k: int) -> None:
    """Copy TOGETHER numbers of `source` (N,), from number n on, to `target` (M,), from number `k` (number) on.

    All are read before one is written, which is one instruction each.
    """
    one, two, three, four = source[n], source[n + 1], source[n + 2], source[n + 3]
    target[k], target[k + 1], target[k + 2], target[k + 3] = one, two, three, four
