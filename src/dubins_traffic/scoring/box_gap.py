"""The distance between two oriented boxes, for the metrics of a batch (compiled)."""

from __future__ import annotations

from math import sqrt

from dubins_traffic.kernels.boxes import Box
from dubins_traffic.kernels.compile import jit


@jit
def box_gap(one: Box, other: Box) -> float:
    """Return the distance between two oriented boxes without their rounding, in metres, 0 where they overlap."""
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
