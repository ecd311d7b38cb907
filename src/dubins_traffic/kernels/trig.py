"""Sines and cosines without a mathematical library, and turning a heading.

Headings are carried as unit vectors (cos, sin); an angle enters only at the edges, through `sincos`.
"""

from __future__ import annotations

from dubins_traffic.kernels.angles import C2, C4, C6, C8, C10, C12, C14, C16, S3, S5, S7, S9, S11, S13, S15
from dubins_traffic.kernels.angles import angle as _plain_angle
from dubins_traffic.kernels.angles import sincos as _plain_sincos
from dubins_traffic.kernels.compile import jit

sincos = jit(_plain_sincos)
angle = jit(_plain_angle)


@jit
def arc_factors(d: float) -> tuple[float, float]:
    """Return (sin d / d, (1 - cos d) / d) for `d` (rad), |d| <= 1/2, by Taylor polynomials (error below 1e-17)."""
    z = d * d
    along = S9 + z * (S11 + z * (S13 + z * S15))
    along = 1.0 + z * (S3 + z * (S5 + z * (S7 + z * along)))
    across = C10 + z * (C12 + z * (C14 + z * C16))
    across = C2 + z * (C4 + z * (C6 + z * (C8 + z * across)))
    return along, -d * across


@jit
def advance(
    x: float, y: float, c: float, s: float, speed: float, yaw_rate: float, dt: float
) -> tuple[float, float, float, float]:
    """Move a unicycle along its exact circular arc for `dt` seconds, |yaw_rate * dt| <= 1/2.

    Returns the new (x, y, cos, sin); the heading is renormalised by one Newton step.
    """
    d = yaw_rate * dt
    along, across = arc_factors(d)
    forward = speed * dt * along
    left = speed * dt * across
    sine = d * along
    cosine = 1.0 - d * across
    c1 = c * cosine - s * sine
    s1 = s * cosine + c * sine
    scale = 1.5 - 0.5 * (c1 * c1 + s1 * s1)
    return x + (forward * c - left * s), y + (forward * s + left * c), c1 * scale, s1 * scale
