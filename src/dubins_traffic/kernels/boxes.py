"""Rounded boxes: distances, and the instant at which two of them meet while each moves on an arc.

A rounded box is given by its centre (x, y), its axis (c, s), its half extents (a, b) along and across the axis and
the radius r by which it is grown. A disc has a = b = 0, an edge b = 0.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.trig import advance

TOUCH = 1e-9
"""Bodies touch when their gap is at most this, metres."""
CLOSING = 1e-12
"""Bodies close when the rate of their gap is below minus this, m/s."""
NEVER = 1e300
_STILL_STEP = 1e-5
_NUMB = 1e-7
"""Two corners nearer than this have no direction free of rounding: the best face normal stands for it."""
_FACE = 1.0 + 1e-6
"""Beyond this ratio to the separation by faces, the nearest features are two corners."""
_CAP = 4096


class Box(NamedTuple):
    """A rounded box: centre (`x`, `y`) in metres, axis (`c`, `s`), and the shape about it, in metres.

    `half_length` lies along the axis and `half_width` across it; `rounding` is the radius by which that is grown.
    """

    x: float
    y: float
    c: float
    s: float
    half_length: float
    half_width: float
    rounding: float


@jit
def corner(k: int, x: float, y: float, c: float, s: float, a: float, b: float) -> tuple[float, float]:
    """Return corner `k` (0 to 3) of a box of half length `a` (m) and half width `b` (m), without its rounding."""
    p = a if k < 2 else -a
    q = b if k % 2 == 0 else -b
    return x + (p * c - q * s), y + (p * s + q * c)


@jit
def nearest_in_box(
    px: float, py: float, x: float, y: float, c: float, s: float, a: float, b: float
) -> tuple[float, float]:
    """Return the point nearest to (px, py) of a box without its rounding: half length `a` (m), half width `b` (m)."""
    dx = px - x
    dy = py - y
    u = min(max(dx * c + dy * s, -a), a)
    v = min(max(dy * c - dx * s, -b), b)
    return x + (u * c - v * s), y + (u * s + v * c)


@jit
def _face_axis(
    x0: float,
    y0: float,
    c0: float,
    s0: float,
    a0: float,
    b0: float,
    x1: float,
    y1: float,
    c1: float,
    s1: float,
    a1: float,
    b1: float,
) -> tuple[float, float, float]:
    """Return (separation, nx, ny) of the face normal, of four, that best separates box 0 from box 1."""
    best = -NEVER
    nx = 1.0
    ny = 0.0
    dx = x1 - x0
    dy = y1 - y0
    for k in range(4):
        if k == 0:
            ex, ey = c0, s0
        elif k == 1:
            ex, ey = -s0, c0
        elif k == 2:
            ex, ey = c1, s1
        else:
            ex, ey = -s1, c1
        along = dx * ex + dy * ey
        if along < 0.0:
            along, ex, ey = -along, -ex, -ey
        own = a0 * abs(c0 * ex + s0 * ey) + b0 * abs(c0 * ey - s0 * ex)
        other = a1 * abs(c1 * ex + s1 * ey) + b1 * abs(c1 * ey - s1 * ex)
        if along - own - other > best:
            best = along - own - other
            nx = ex
            ny = ey
    return best, nx, ny


@jit
def separation(
    x0: float,
    y0: float,
    c0: float,
    s0: float,
    a0: float,
    b0: float,
    r0: float,
    x1: float,
    y1: float,
    c1: float,
    s1: float,
    a1: float,
    b1: float,
    r1: float,
) -> tuple[float, float, float, float, float]:
    """Return (gap, nx, ny, px, py): the gap between two rounded boxes (negative: overlap), the unit normal from
    the first to the second, and the point of the first nearest to the second.
    """
    best = NEVER
    px = x0
    py = y0
    qx = x1
    qy = y1
    for k in range(4):
        ex, ey = corner(k, x0, y0, c0, s0, a0, b0)
        fx, fy = nearest_in_box(ex, ey, x1, y1, c1, s1, a1, b1)
        d2 = (fx - ex) * (fx - ex) + (fy - ey) * (fy - ey)
        if d2 < best:
            best, px, py, qx, qy = d2, ex, ey, fx, fy
        fx, fy = corner(k, x1, y1, c1, s1, a1, b1)
        ex, ey = nearest_in_box(fx, fy, x0, y0, c0, s0, a0, b0)
        d2 = (fx - ex) * (fx - ex) + (fy - ey) * (fy - ey)
        if d2 < best:
            best, px, py, qx, qy = d2, ex, ey, fx, fy
    face, nx, ny = _face_axis(x0, y0, c0, s0, a0, b0, x1, y1, c1, s1, a1, b1)
    core = sqrt(best)
    if core > _NUMB and core > face * _FACE > 0.0:
        nx = (qx - px) / core
        ny = (qy - py) / core
    else:
        core = face
    return core - r0 - r1, nx, ny, px + nx * r0, py + ny * r0


@jit
def _lower_root(gap: float, rate: float, bend: float) -> float:
    """Return the first time at which gap + rate t - bend t^2 / 2 may reach zero (gap >= 0)."""
    if rate < -CLOSING:
        return 2.0 * gap / (sqrt(rate * rate + 2.0 * bend * gap) - rate)
    rate = max(rate, 0.0)
    if bend <= 0.0:
        return NEVER
    return max((rate + sqrt(rate * rate + 2.0 * bend * gap)) / bend, _STILL_STEP)


@jit
def disc_contact(
    x0: float,
    y0: float,
    c0: float,
    s0: float,
    u0: float,
    w0: float,
    until0: float,
    x1: float,
    y1: float,
    c1: float,
    s1: float,
    u1: float,
    w1: float,
    until1: float,
    reach: float,
    begin: float,
    end: float,
) -> float:
    """Return the first instant from `begin` (s) to `end` (s) of a tick at which two discs touch and close, or NEVER.

    Disc i starts the tick at (xi, yi, ci, si), holds (ui, wi) until `untili` and stands from then on; `reach` is
    the sum of the radii. The distance of the centres bends downward by at most the sum of the accelerations
    |u w|, so each step goes to where a parabola below it meets zero: no step can jump over a contact, and the
    steps converge like Newton's.
    """
    t = begin
    for _ in range(_CAP):
        px, py, pc, ps = advance(x0, y0, c0, s0, u0, w0, min(t, until0))
        qx, qy, qc, qs = advance(x1, y1, c1, s1, u1, w1, min(t, until1))
        v0 = u0 if t < until0 else 0.0
        v1 = u1 if t < until1 else 0.0
        dx = qx - px
        dy = qy - py
        d = sqrt(dx * dx + dy * dy)
        nx, ny = (dx / d, dy / d) if d > 0.0 else (1.0, 0.0)
        rate = nx * (v1 * qc - v0 * pc) + ny * (v1 * qs - v0 * ps)
        bend = abs(v0 * w0) + abs(v1 * w1)
        gap = d - reach
        if gap <= TOUCH:
            if rate < -CLOSING:
                return t
            gap = max(gap, 0.0)
        elif rate < -CLOSING:
            gap -= 0.5 * TOUCH
        t += _lower_root(gap, rate, bend)
        if t > end:
            return NEVER
    return NEVER


@jit
def _box_step(
    nx: float,
    ny: float,
    x0: float,
    y0: float,
    c0: float,
    s0: float,
    v0: float,
    w0: float,
    a0: float,
    b0: float,
    r0: float,
    x1: float,
    y1: float,
    c1: float,
    s1: float,
    v1: float,
    w1: float,
    a1: float,
    b1: float,
    r1: float,
) -> float:
    """Return a time during which no two corners can meet along the normal, or -1 if two touch and close."""
    step = NEVER
    for i in range(4):
        ex, ey = corner(i, x0, y0, c0, s0, a0, b0)
        arm0 = sqrt((ex - x0) * (ex - x0) + (ey - y0) * (ey - y0))
        out0 = nx * (v0 * c0 - w0 * (ey - y0)) + ny * (v0 * s0 + w0 * (ex - x0))
        bend0 = abs(v0 * w0) + w0 * w0 * arm0
        for j in range(4):
            fx, fy = corner(j, x1, y1, c1, s1, a1, b1)
            arm1 = sqrt((fx - x1) * (fx - x1) + (fy - y1) * (fy - y1))
            out1 = nx * (v1 * c1 - w1 * (fy - y1)) + ny * (v1 * s1 + w1 * (fx - x1))
            bend = bend0 + abs(v1 * w1) + w1 * w1 * arm1
            gap = nx * (fx - ex) + ny * (fy - ey) - r0 - r1
            rate = out1 - out0
            if gap <= TOUCH:
                if rate < -CLOSING:
                    return -1.0
                gap = max(gap, 0.0)
            elif rate < -CLOSING:
                gap -= 0.5 * TOUCH
            step = min(step, _lower_root(gap, rate, bend))
    return step


@jit
def box_contact(
    x0: float,
    y0: float,
    c0: float,
    s0: float,
    u0: float,
    w0: float,
    until0: float,
    a0: float,
    b0: float,
    r0: float,
    x1: float,
    y1: float,
    c1: float,
    s1: float,
    u1: float,
    w1: float,
    until1: float,
    a1: float,
    b1: float,
    r1: float,
    begin: float,
    end: float,
) -> float:
    """Return the first instant from `begin` (s) to `end` (s) at which two rounded boxes touch and close, or NEVER.

    As `disc_contact`: along the normal between the nearest features, the gap of every two corners is bounded
    below by a parabola, and the step is the least of their roots.
    """
    t = begin
    for _ in range(_CAP):
        px, py, pc, ps = advance(x0, y0, c0, s0, u0, w0, min(t, until0))
        qx, qy, qc, qs = advance(x1, y1, c1, s1, u1, w1, min(t, until1))
        v0, yaw0 = (u0, w0) if t < until0 else (0.0, 0.0)
        v1, yaw1 = (u1, w1) if t < until1 else (0.0, 0.0)
        _, nx, ny, _, _ = separation(px, py, pc, ps, a0, b0, r0, qx, qy, qc, qs, a1, b1, r1)
        step = _box_step(
            nx, ny, px, py, pc, ps, v0, yaw0, a0, b0, r0, qx, qy, qc, qs, v1, yaw1, a1, b1, r1
        )  # fmt: skip
        if step < 0.0:
            return t
        t += step
        if t > end:
            return NEVER
    return NEVER
