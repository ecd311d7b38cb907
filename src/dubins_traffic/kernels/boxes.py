"""Rounded boxes: distances, and the instant at which two of them meet while each moves on an arc.

A rounded box is a rectangle grown by a radius (`Box`): a disc has no length and no width, an edge no width.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from dubins_traffic.kernels.compile import jit, jit_inline
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


class Drive(NamedTuple):
    """How a body moves in a tick: `speed` (m/s) and `yaw_rate` (rad/s), held for `until` seconds; then it stands."""

    speed: float
    yaw_rate: float
    until: float


@jit_inline
def driven(box: Box, drive: Drive, t: float) -> Box:
    """Return where a body is `t` (s) after the tick's beginning."""
    x, y, c, s = advance(box.x, box.y, box.c, box.s, drive.speed, drive.yaw_rate, min(t, drive.until))
    return Box(x, y, c, s, box.half_length, box.half_width, box.rounding)


@jit_inline
def held(drive: Drive, t: float) -> Drive:
    """Return how a body moves at `t` (s) after the tick's beginning."""
    moves = t < drive.until
    return Drive(drive.speed if moves else 0.0, drive.yaw_rate if moves else 0.0, drive.until)


@jit
def corner(k: int, box: Box) -> tuple[float, float]:
    """Return corner `k` (0 to 3) of a box without its rounding."""
    p = box.half_length if k < 2 else -box.half_length
    q = box.half_width if k % 2 == 0 else -box.half_width
    return box.x + (p * box.c - q * box.s), box.y + (p * box.s + q * box.c)


@jit
def nearest_in_box(px: float, py: float, box: Box) -> tuple[float, float]:
    """Return the point nearest to (px, py) of a box without its rounding."""
    dx = px - box.x
    dy = py - box.y
    u = min(max(dx * box.c + dy * box.s, -box.half_length), box.half_length)
    v = min(max(dy * box.c - dx * box.s, -box.half_width), box.half_width)
    return box.x + (u * box.c - v * box.s), box.y + (u * box.s + v * box.c)


@jit
def _face_axis(one: Box, other: Box) -> tuple[float, float, float]:
    """Return (separation, nx, ny) of the face normal, of four, that best separates one box from another."""
    best = -NEVER
    nx = 1.0
    ny = 0.0
    dx = other.x - one.x
    dy = other.y - one.y
    for k in range(4):
        if k == 0:
            ex, ey = one.c, one.s
        elif k == 1:
            ex, ey = -one.s, one.c
        elif k == 2:
            ex, ey = other.c, other.s
        else:
            ex, ey = -other.s, other.c
        along = dx * ex + dy * ey
        if along < 0.0:
            along, ex, ey = -along, -ex, -ey
        half = _half_extent(one, ex, ey)
        across = _half_extent(other, ex, ey)
        if along - half - across > best:
            best = along - half - across
            nx = ex
            ny = ey
    return best, nx, ny


@jit_inline
def _half_extent(box: Box, ex: float, ey: float) -> float:
    """Return half the extent of a box, without its rounding, along a unit vector."""
    return box.half_length * abs(box.c * ex + box.s * ey) + box.half_width * abs(box.c * ey - box.s * ex)


@jit
def separation(one: Box, other: Box) -> tuple[float, float, float, float, float]:
    """Return (gap, nx, ny, px, py): the gap between two rounded boxes (negative: overlap), the unit normal from
    the first to the second, and the point of the first nearest to the second.
    """
    best = NEVER
    px = one.x
    py = one.y
    qx = other.x
    qy = other.y
    for k in range(4):
        ex, ey = corner(k, one)
        fx, fy = nearest_in_box(ex, ey, other)
        d2 = (fx - ex) * (fx - ex) + (fy - ey) * (fy - ey)
        if d2 < best:
            best, px, py, qx, qy = d2, ex, ey, fx, fy
        fx, fy = corner(k, other)
        ex, ey = nearest_in_box(fx, fy, one)
        d2 = (fx - ex) * (fx - ex) + (fy - ey) * (fy - ey)
        if d2 < best:
            best, px, py, qx, qy = d2, ex, ey, fx, fy
    face, nx, ny = _face_axis(one, other)
    core = sqrt(best)
    if core > _NUMB and core > face * _FACE > 0.0:
        nx = (qx - px) / core
        ny = (qy - py) / core
    else:
        core = face
    return core - one.rounding - other.rounding, nx, ny, px + nx * one.rounding, py + ny * one.rounding


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
def disc_contact(one: Box, drive: Drive, other: Box, its: Drive, begin: float, end: float) -> float:
    """Return the first instant from `begin` (s) to `end` (s) of a tick at which two discs touch and close, or NEVER.

    Each starts the tick in its box, of which only centre, axis and rounding count. The distance of the centres bends
    downward by at most the sum of the accelerations |u w|, so each step goes to where a parabola below it meets zero:
    no step can jump over a contact, and the steps converge like Newton's.
    """
    reach = one.rounding + other.rounding
    t = begin
    for _ in range(_CAP):
        p = driven(one, drive, t)
        q = driven(other, its, t)
        u0, w0, _ = held(drive, t)
        u1, w1, _ = held(its, t)
        dx = q.x - p.x
        dy = q.y - p.y
        d = sqrt(dx * dx + dy * dy)
        nx, ny = (dx / d, dy / d) if d > 0.0 else (1.0, 0.0)
        rate = nx * (u1 * q.c - u0 * p.c) + ny * (u1 * q.s - u0 * p.s)
        bend = abs(u0 * w0) + abs(u1 * w1)
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
def _corner_motion(k: int, box: Box, nx: float, ny: float, u: float, w: float) -> tuple[float, float, float, float]:
    """Return a corner of a box that drives at u, w: place, speed along a normal, distance from the centre."""
    x, y = corner(k, box)
    arm = sqrt((x - box.x) * (x - box.x) + (y - box.y) * (y - box.y))
    out = nx * (u * box.c - w * (y - box.y)) + ny * (u * box.s + w * (x - box.x))
    return x, y, out, arm


@jit
def _box_step(nx: float, ny: float, one: Box, drive: Drive, other: Box, its: Drive) -> float:
    """Return a time during which no two corners can meet along the normal, or -1 if two touch and close."""
    u0, w0 = drive.speed, drive.yaw_rate
    u1, w1 = its.speed, its.yaw_rate
    step = NEVER
    for i in range(4):
        ex, ey, out0, arm0 = _corner_motion(i, one, nx, ny, u0, w0)
        bend0 = abs(u0 * w0) + w0 * w0 * arm0
        for j in range(4):
            fx, fy, out1, arm1 = _corner_motion(j, other, nx, ny, u1, w1)
            bend = bend0 + abs(u1 * w1) + w1 * w1 * arm1
            gap = nx * (fx - ex) + ny * (fy - ey) - one.rounding - other.rounding
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
def box_contact(one: Box, drive: Drive, other: Box, its: Drive, begin: float, end: float) -> float:
    """Return the first instant from `begin` (s) to `end` (s) at which two rounded boxes touch and close, or NEVER.

    As `disc_contact`: along the normal between the nearest features, the gap of every two corners is bounded
    below by a parabola, and the step is the least of their roots.
    """
    t = begin
    for _ in range(_CAP):
        p = driven(one, drive, t)
        q = driven(other, its, t)
        _, nx, ny, _, _ = separation(p, q)
        step = _box_step(nx, ny, p, held(drive, t), q, held(its, t))
        if step < 0.0:
            return t
        t += step
        if t > end:
            return NEVER
    return NEVER


@jit
def box_gap(one: Box, other: Box) -> float:
    """Return the distance between two boxes without their rounding, metres, 0 where they overlap.

    `separation` tells besides where they are nearest, in steps that round otherwise; scores are of this one.
    """
    if _overlap(one, other):
        return 0.0
    return min(_corners_to_box(one, other), _corners_to_box(other, one))


@jit
def _corners_to_box(one: Box, other: Box) -> float:
    best = 1e300
    for k in range(4):
        along = one.half_length if k < 2 else -one.half_length
        across = one.half_width if k % 2 == 0 else -one.half_width
        x = one.x + one.c * along - one.s * across - other.x
        y = one.y + one.s * along + one.c * across - other.y
        dx = max(abs(other.c * x + other.s * y) - other.half_length, 0.0)
        dy = max(abs(other.c * y - other.s * x) - other.half_width, 0.0)
        best = min(best, sqrt(dx * dx + dy * dy))
    return best


@jit
def _overlap(one: Box, other: Box) -> bool:
    """Tell whether no side of either box separates them."""
    x = other.x - one.x
    y = other.y - one.y
    c = abs(one.c * other.c + one.s * other.s)
    s = abs(one.c * other.s - one.s * other.c)
    return (
        abs(one.c * x + one.s * y) <= one.half_length + c * other.half_length + s * other.half_width
        and abs(one.c * y - one.s * x) <= one.half_width + s * other.half_length + c * other.half_width
        and abs(other.c * x + other.s * y) <= other.half_length + c * one.half_length + s * one.half_width
        and abs(other.c * y - other.s * x) <= other.half_width + s * one.half_length + c * one.half_width
    )
