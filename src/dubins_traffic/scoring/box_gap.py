"""How far two oriented boxes are apart, compiled: the gaps that the metrics of a batch look at."""

from __future__ import annotations

from math import sqrt

from dubins_traffic.kernels.compile import jit


@jit
def box_gap(
    ax: float, ay: float, ac: float, az: float, a_length: float, a_width: float,
    bx: float, by: float, bc: float, bz: float, b_length: float, b_width: float,
) -> float:  # fmt: skip
    """Return the distance between two oriented boxes, 0 where they overlap, as `scoring.clearance.box_distance` does.

    A box is its centre, the cosine and sine of its heading, its half length and half width.
    """
    if _overlap(ax, ay, ac, az, a_length, a_width, bx, by, bc, bz, b_length, b_width):
        return 0.0
    return min(
        _corners_to_box(ax, ay, ac, az, a_length, a_width, bx, by, bc, bz, b_length, b_width),
        _corners_to_box(bx, by, bc, bz, b_length, b_width, ax, ay, ac, az, a_length, a_width),
    )


@jit
def _corners_to_box(
    ax: float, ay: float, ac: float, az: float, a_length: float, a_width: float,
    bx: float, by: float, bc: float, bz: float, b_length: float, b_width: float,
) -> float:  # fmt: skip
    best = 1e300
    for k in range(4):
        along = a_length if k < 2 else -a_length
        across = a_width if k % 2 == 0 else -a_width
        x = ax + ac * along - az * across - bx
        y = ay + az * along + ac * across - by
        dx = max(abs(bc * x + bz * y) - b_length, 0.0)
        dy = max(abs(bc * y - bz * x) - b_width, 0.0)
        best = min(best, sqrt(dx * dx + dy * dy))
    return best


@jit
def _overlap(
    ax: float, ay: float, ac: float, az: float, a_length: float, a_width: float,
    bx: float, by: float, bc: float, bz: float, b_length: float, b_width: float,
) -> bool:  # fmt: skip
    """Tell whether no side of either box separates them."""
    x = bx - ax
    y = by - ay
    c = abs(ac * bc + az * bz)
    s = abs(ac * bz - az * bc)
    return (
        abs(ac * x + az * y) <= a_length + c * b_length + s * b_width
        and abs(ac * y - az * x) <= a_width + s * b_length + c * b_width
        and abs(bc * x + bz * y) <= b_length + c * a_length + s * a_width
        and abs(bc * y - bz * x) <= b_width + s * a_length + c * a_width
    )
