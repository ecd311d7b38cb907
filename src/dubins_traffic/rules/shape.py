"""Geometry of a car's body relative to discs and lanes."""

from __future__ import annotations

from typing import Any, Protocol

from dubins_traffic.cars.state import State
from dubins_traffic.kernels.boxes import Box, nearest_in_box
from dubins_traffic.kernels.compile import jit, jit_inline


@jit
def distance2_to_body(
    px: float, py: float, x: float, y: float, c: float, s: float, half_length: float, half_width: float
) -> float:
    """Return the squared distance of (px, py) from a body without its rounding, square metres."""
    qx, qy = nearest_in_box(px, py, Box(x, y, c, s, half_length, half_width, 0.0))
    return (px - qx) * (px - qx) + (py - qy) * (py - qy)


class Shape(Protocol):
    """A body, a rounded box: fields of a row or of a tuple, metres."""

    @property
    def half_length(self) -> float:
        """Half its length, without the rounding."""
        ...

    @property
    def half_width(self) -> float:
        """Half its width, likewise."""
        ...

    @property
    def rounding(self) -> float:
        """The radius by which it is grown."""
        ...


@jit
def half_extent(tx: float, ty: float, c: float, s: float, body: Shape) -> float:
    """Return half the extent of a `body` (m) with the heading (c, s) across the direction (tx, ty), metres."""
    along = abs(c * ty - s * tx)
    across = abs(c * tx + s * ty)
    return along * body.half_length + across * body.half_width + body.rounding


@jit_inline
def half_across(b: int, n: Any, tx: float, ty: float, state: State, body: Shape) -> float:
    """Return half the extent of car `n` (index), whose `body` (m) is given, across the direction (tx, ty), metres."""
    return half_extent(tx, ty, state.c[b, n], state.s[b, n], body)
