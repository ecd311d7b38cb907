"""Clip and move cars that can't meet, in loops without branches over the cars of several trials at once.

Arrays are flat over all cars of a batch, trial after trial (views of the (B, N) arrays), so that one instruction of the
processor works on many cars. Contacts are left to `cars.motion`, which calls `move` for the trials in which no two
bodies can meet during the tick: nearly all of them.
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
"""Most trials that are clipped and compared together: their arrays fit the processor's nearest memory."""
TOGETHER = 8
"""Cars of one trial that `move_together` moves at once, if the trial has a multiple of as many places."""


class MotionConstants(Tables):
    """Constants of a batch from its cars' bounds, one value per trial (B,), except `mask` and `close`.

    `low`, `high`: bounds on the speed, m/s. `most` (rad/s), `slack` (rad/s), `curvature` (1/m): the yaw rate w at the
    speed v is bounded by |w| <= min(most, slack + curvature |v|). `far`: how far from its centre at the beginning of a
    tick a car's body may reach in that tick, m. `near`: squared distance of the centres within which two cars may meet
    in a tick, m2. `alike`: how many trials from this one on have the same constants, at most RUN. `mask` (N, RUN * N):
    1 where the car o places on is of the same trial, else 0. `close` (RUN * N,): scratch of `find_close`. `mask` and
    `close` have no columns if there are more than FEW cars.
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


def rows(cars: CarTable, n: int, dt: float) -> MotionConstants:
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
    return MotionConstants(*constants, alike=_alike(np.stack(constants)), mask=mask, close=close)


@lru_cache(maxsize=FEW)
def _mask(n: int) -> Floats:
    """Return `MotionConstants.mask`, which is only read, for `n` places; batches share it."""
    place = np.arange(RUN * n if n <= FEW else 0) % n
    return np.array([place + shift < n for shift in range(n)], dtype=np.float64)


def _alike(columns: Floats) -> Ints:
    alike = [1]
    for same in reversed((columns[:, :-1] == columns[:, 1:]).all(axis=0).tolist()):
        alike.append(min(alike[-1] + 1, RUN) if same else 1)
    return np.array(alike[::-1], dtype=np.int64)


@jit
def clip(r: MotionConstants, b: int, commands: Floats, speed: Floats, yaw: Floats, first: int, last: int) -> None:
    """Clip `commands` (B * N, 2) of the cars `first` (index) to `last` (index) - 1, whose bounds are those of trial b.

    They are clipped in place, the speed first, and also written to `speed` (B * N,), m/s, and `yaw` (B * N,), rad/s.
    """
    low, high, most, slack, curvature = r.low[b], r.high[b], r.most[b], r.slack[b], r.curvature[b]
    asked, speed, yaw = commands[first:last], speed[first:last], yaw[first:last]
    for f in range(last - first):
        u = min(max(asked[f, 0], low), high)
        bound = min(most, slack + curvature * abs(u))
        w = min(max(asked[f, 1], -bound), bound)
        asked[f, 0] = u
        asked[f, 1] = w
        speed[f] = u
        yaw[f] = w


@jit
def find_close(r: MotionConstants, b: int, x: Floats, y: Floats, n: int, first: int, last: int) -> int:
    """Set `MotionConstants.close` for each car that may meet a later one of its trial; return how many are set.

    The cars are `first` (index) to `last` (index) - 1 of `x` (B * N,) and `y` (B * N,), metres; each trial has n.
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
    """Tell whether the squared distance of any two of the first `cars` (count) cars is less than `near` (m^2).

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

    `x` (K,) and `y` (K,) are centres, metres, `c` (K,) and `s` (K,) headings; they are updated in place. `speed` (K,),
    m/s, and `yaw` (K,), rad/s, are held.
    """
    for f in range(x.shape[0]):
        x[f], y[f], c[f], s[f] = advance(x[f], y[f], c[f], s[f], speed[f], yaw[f], dt)


@jit
def move_together(x: Floats, y: Floats, c: Floats, s: Floats, speed: Floats, yaw: Floats, dt: float) -> None:
    """Do as `move` for all places of one trial: `x` (N,), `y` (N,), `c` (N,), `s` (N,), `speed` (N,), `yaw` (N,).

    The work on TOGETHER cars is written out without a loop, so that the compiler makes one instruction of it; of a loop
    it would make instructions on more cars than a trial has. All values are read before any is written.
    """
    for f in range(0, x.shape[0], TOGETHER):
        x0, y0, c0, s0 = advance(x[f], y[f], c[f], s[f], speed[f], yaw[f], dt)
        x1, y1, c1, s1 = advance(x[f + 1], y[f + 1], c[f + 1], s[f + 1], speed[f + 1], yaw[f + 1], dt)
        x2, y2, c2, s2 = advance(x[f + 2], y[f + 2], c[f + 2], s[f + 2], speed[f + 2], yaw[f + 2], dt)
        x3, y3, c3, s3 = advance(x[f + 3], y[f + 3], c[f + 3], s[f + 3], speed[f + 3], yaw[f + 3], dt)
        x4, y4, c4, s4 = advance(x[f + 4], y[f + 4], c[f + 4], s[f + 4], speed[f + 4], yaw[f + 4], dt)
        x5, y5, c5, s5 = advance(x[f + 5], y[f + 5], c[f + 5], s[f + 5], speed[f + 5], yaw[f + 5], dt)
        x6, y6, c6, s6 = advance(x[f + 6], y[f + 6], c[f + 6], s[f + 6], speed[f + 6], yaw[f + 6], dt)
        x7, y7, c7, s7 = advance(x[f + 7], y[f + 7], c[f + 7], s[f + 7], speed[f + 7], yaw[f + 7], dt)
        x[f], x[f + 1], x[f + 2], x[f + 3] = x0, x1, x2, x3
        x[f + 4], x[f + 5], x[f + 6], x[f + 7] = x4, x5, x6, x7
        y[f], y[f + 1], y[f + 2], y[f + 3] = y0, y1, y2, y3
        y[f + 4], y[f + 5], y[f + 6], y[f + 7] = y4, y5, y6, y7
        c[f], c[f + 1], c[f + 2], c[f + 3] = c0, c1, c2, c3
        c[f + 4], c[f + 5], c[f + 6], c[f + 7] = c4, c5, c6, c7
        s[f], s[f + 1], s[f + 2], s[f + 3] = s0, s1, s2, s3
        s[f + 4], s[f + 5], s[f + 6], s[f + 7] = s4, s5, s6, s7


@jit_inline
def copy_together(source: Floats, n: int, target: Floats, k: int) -> None:
    """Copy TOGETHER numbers of `source` (N,), from number n on, to `target` (M,), from number `k` (number) on.

    All are read before any is written, so that the compiler makes one instruction of each.
    """
    a0, a1, a2, a3 = source[n], source[n + 1], source[n + 2], source[n + 3]
    a4, a5, a6, a7 = source[n + 4], source[n + 5], source[n + 6], source[n + 7]
    target[k], target[k + 1], target[k + 2], target[k + 3] = a0, a1, a2, a3
    target[k + 4], target[k + 5], target[k + 6], target[k + 7] = a4, a5, a6, a7
