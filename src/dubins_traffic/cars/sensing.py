"""What a car perceives: the cars within a radius, with seeded noise, and a laser scan."""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from dubins_traffic.cars.state import NONE, Labels, State
from dubins_traffic.cars.tables import CarTable, ObstacleTable
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.boxes import NEVER
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.random import bell
from dubins_traffic.kernels.trig import sincos

POSITION_DRAW = 200
HEADING_DRAW = 206
SEEN_REALS = 6
SEEN_WHOLES = 6


@jit
def neighbours(
    b: int, viewer: int, radius: float, reals: Floats, wholes: Ints, state: State, labels: Labels
) -> int:
    """Write car `viewer` (index), then the others within `radius` (m), by index, into two arrays; return how many.

    A row of `reals` (N, SEEN_REALS) is x, y, cos, sin, speed, yaw rate; one of `wholes` (N, SEEN_WHOLES) is index,
    segment, at, crosses, lane, bits, and the first row that is free begins with NONE. Where `wholes` was
    as it is now already, minus the number is returned.
    """
    limit = radius * radius
    x = state.x[b, viewer]
    y = state.y[b, viewer]
    other = _view(state, labels, b, viewer, reals[0], wholes[0])
    count = 1
    for n in range(state.count[b]):
        dx = state.x[b, n] - x
        dy = state.y[b, n] - y
        if n != viewer and dx * dx + dy * dy <= limit:
            other |= _view(state, labels, b, n, reals[count], wholes[count])
            count += 1
    if count < wholes.shape[0]:
        other |= wholes[count, 0] ^ NONE
        wholes[count, 0] = NONE
    return count if other != 0 else -count


@jit
def _view(state: State, labels: Labels, b: int, n: int, reals: Floats, wholes: Ints) -> int:
    """Write car n into a row of each array; return 0 if that of `wholes` stays as it was."""
    reals[0] = state.x[b, n]
    reals[1] = state.y[b, n]
    reals[2] = state.c[b, n]
    reals[3] = state.s[b, n]
    reals[4] = state.speed[b, n]
    reals[5] = state.yaw_rate[b, n]
    bits = np.int64(labels.bits[b, n])
    other = (wholes[0] ^ n) | (wholes[1] ^ labels.segment[b, n]) | (wholes[2] ^ labels.at[b, n])
    other |= (wholes[3] ^ labels.crosses[b, n]) | (wholes[4] ^ labels.lane[b, n]) | (wholes[5] ^ bits)
    wholes[0] = n
    wholes[1] = labels.segment[b, n]
    wholes[2] = labels.at[b, n]
    wholes[3] = labels.crosses[b, n]
    wholes[4] = labels.lane[b, n]
    wholes[5] = bits
    return other


@jit
def blur(
    reals: Floats, wholes: Ints, count: int, seed: Any, trial: int, tick: int, position: float, heading: float
) -> None:
    """Add noise to the poses seen: standard deviations `position` (m, each axis) and `heading` (rad).

    The first `count` (count) rows of `reals` (N, SEEN_REALS) and `wholes` (N, SEEN_WHOLES) are those of `neighbours`.
    """
    for k in range(count):
        row = reals[k]
        car = wholes[k, 0]
        row[0] += position * bell(seed, trial, car, tick, POSITION_DRAW)
        row[1] += position * bell(seed, trial, car, tick, POSITION_DRAW + 3)
        c, s = sincos(heading * bell(seed, trial, car, tick, HEADING_DRAW))
        row[2], row[3] = row[2] * c - row[3] * s, row[3] * c + row[2] * s


@jit
def ray_box(
    px: float,
    py: float,
    ex: float,
    ey: float,
    x: float,
    y: float,
    c: float,
    s: float,
    a: float,
    b: float,
    r: float,
) -> float:
    """Return how far the ray from (px, py) along a unit vector goes to a rounded box, metres, or NEVER.

    The vector has the components `ex` (unit) and `ey` (unit); the box has half length `a` (m), half width `b` (m) and
    rounding `r` (m). A rounded box is the union of two crossed boxes and four discs at the corners. 0 if the ray begins
    inside.
    """  # fmt: skip
    dx = px - x
    dy = py - y
    u = dx * c + dy * s
    v = dy * c - dx * s
    eu = ex * c + ey * s
    ev = ey * c - ex * s
    best = NEVER
    if a + b > 0.0:
        best = min(_ray_slab(u, v, eu, ev, a + r, b), _ray_slab(u, v, eu, ev, a, b + r))
    if r > 0.0:
        for k in range(4):
            cu = a if k < 2 else -a
            cv = b if k % 2 == 0 else -b
            best = min(best, _ray_disc(u - cu, v - cv, eu, ev, r))
    return best


@jit
def _ray_disc(u: float, v: float, eu: float, ev: float, r: float) -> float:
    along = u * eu + v * ev
    outside = u * u + v * v - r * r
    if outside <= 0.0:
        return 0.0
    square = along * along - outside
    if along >= 0.0 or square < 0.0:
        return NEVER
    return -along - sqrt(square)


@jit
def _ray_slab(u: float, v: float, eu: float, ev: float, a: float, b: float) -> float:
    near = 0.0
    far = NEVER
    for k in range(2):
        p, e, h = (u, eu, a) if k == 0 else (v, ev, b)
        if abs(e) < 1e-12:
            if abs(p) > h:
                return NEVER
        else:
            t0 = (-h - p) / e
            t1 = (h - p) / e
            near = max(near, min(t0, t1))
            far = min(far, max(t0, t1))
    return near if near <= far else NEVER


@jit
def scan(
    state: State,
    b: int,
    viewer: int,
    cars: CarTable,
    obstacles: ObstacleTable,
    rays: Floats,
    shortest: float,
    longest: float,
    ranges: Floats,
) -> None:
    """Write the laser ranges of car `viewer` (index) in metres into `ranges` (R,).

    `rays` (R, 2) are unit vectors in the car's frame. As REP 117 of ROS says, a ray that meets nothing within
    `longest` (m) reads +inf, and one that meets something nearer than `shortest` (m) reads -inf.
    """  # fmt: skip
    x, y = state.x[b, viewer], state.y[b, viewer]
    c, s = state.c[b, viewer], state.s[b, viewer]
    count = rays.shape[0]
    for k in range(count):
        ranges[k] = NEVER
    far = longest + cars.reach[b]
    for n in range(state.count[b]):
        dx = state.x[b, n] - x
        dy = state.y[b, n] - y
        if n != viewer and dx * dx + dy * dy < far * far:
            for k in range(count):
                ex = rays[k, 0] * c - rays[k, 1] * s
                ey = rays[k, 0] * s + rays[k, 1] * c
                hit = ray_box(
                    x, y, ex, ey, state.x[b, n], state.y[b, n], state.c[b, n], state.s[b, n],
                    cars.half_length[b], cars.half_width[b], cars.rounding[b],
                )  # fmt: skip
                ranges[k] = min(ranges[k], hit)
    for p in range(obstacles.off[b], obstacles.off[b + 1]):
        row = obstacles.part[p]
        dx = row[0] - x
        dy = row[1] - y
        far = longest + row[7]
        if dx * dx + dy * dy < far * far:
            for k in range(count):
                ex = rays[k, 0] * c - rays[k, 1] * s
                ey = rays[k, 0] * s + rays[k, 1] * c
                hit = ray_box(x, y, ex, ey, row[0], row[1], row[2], row[3], row[4], row[5], row[6])
                ranges[k] = min(ranges[k], hit)
    for k in range(count):
        if ranges[k] > longest:
            ranges[k] = np.inf
        elif ranges[k] < shortest:
            ranges[k] = -np.inf
