"""Geometry of a car's body relative to discs and lanes."""

from __future__ import annotations

from dubins_traffic.kernels.boxes import Box, nearest_in_box
from dubins_traffic.kernels.compile import jit


@jit
def distance2_to_body(
    px: float, py: float, x: float, y: float, c: float, s: float, half_length: float, half_width: float
) -> float:
    """Return the squared distance of (px, py) from a body without its rounding, square metres."""
    qx, qy = nearest_in_box(px, py, Box(x, y, c, s, half_length, half_width, 0.0))
    return (px - qx) * (px - qx) + (py - qy) * (py - qy)


@jit
def half_extent(
    tx: float, ty: float, c: float, s: float, half_length: float, half_width: float, rounding: float
) -> float:
    """Return half the extent of a body across the direction (tx, ty), metres."""
    along = abs(c * ty - s * tx)
    across = abs(c * tx + s * ty)
    return along * half_length + across * half_width + rounding
