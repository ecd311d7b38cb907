"""Sines, cosines and angles without a mathematical library: plain functions, compiled in `kernels.trig`."""

from __future__ import annotations

from math import factorial

import numpy as np

from dubins_traffic.kernels.arrays import Floats

TWO_OVER_PI = 0.6366197723675814
# pi/2 in three parts of 33, 33 and 53 bits: n * PART is exact for |n| < 2**20.
PART1 = 1.5707963267341256
PART2 = 6.077100506303966e-11
PART3 = 2.0222662487959506e-21

S3, S5, S7, S9, S11, S13, S15, S17 = ((-1.0) ** k / factorial(2 * k + 1) for k in range(1, 9))
C2, C4, C6, C8, C10, C12, C14, C16, C18 = ((-1.0) ** k / factorial(2 * k) for k in range(1, 10))


def sincos(theta: float) -> tuple[float, float]:
    """Return (cos theta, sin theta), each within 1 ulp for |theta| <= 1e6.

    Range reduction by multiples of pi/2 in three parts (Cody and Waite), Taylor polynomials on [-pi/4, pi/4].
    """
    turns = theta * TWO_OVER_PI
    n = int(turns + 0.5) if turns >= 0.0 else -int(0.5 - turns)
    k = float(n)
    first = theta - k * PART1
    second = k * PART2
    r = first - second
    shift = r - first
    low = ((first - (r - shift)) - (second + shift)) - k * PART3
    z = r * r
    tail = S5 + z * (S7 + z * (S9 + z * (S11 + z * (S13 + z * (S15 + z * S17)))))
    sine = r + (low * (1.0 - 0.5 * z) + r * z * (S3 + z * tail))
    tail = C4 + z * (C6 + z * (C8 + z * (C10 + z * (C12 + z * (C14 + z * (C16 + z * C18))))))
    half = 0.5 * z
    near = 1.0 - half
    cosine = near + (((1.0 - near) - half) + (z * z * tail - low * (r + r * z * S3)))
    quadrant = n & 3
    if quadrant == 0:
        return cosine, sine
    if quadrant == 1:
        return -sine, cosine
    if quadrant == 2:
        return -cosine, -sine
    return sine, -cosine


HALF_PI = 1.5707963267948966
QUARTER_PI = 0.7853981633974483
TAN_EIGHTH_PI = 0.41421356237309503
P0, P1, P2, P3, P4 = (
    -6.485021904942025371773e1, -1.228866684490136173410e2, -7.500855792314704667340e1, -1.615753718733365076637e1,
    -8.750608600031904122785e-1,
)  # fmt: skip
Q0, Q1, Q2, Q3, Q4 = (
    1.945506571482613964425e2, 4.853903996359136964868e2, 4.328810604912902668951e2, 1.650270098316988542046e2,
    2.485846490142306297962e1,
)  # fmt: skip


def angle(y: float, x: float) -> float:
    """Return the angle of the vector (x, y) for y >= 0, in [0, pi], rad; within 2 ulp; 0 for the vector 0.

    The rational approximation of the arctangent on [0, tan(pi/8)] is that of Cephes; other angles come back to it.
    """
    wide = abs(x)
    low, high = (y, wide) if y <= wide else (wide, y)
    if high == 0.0:
        return 0.0
    t = low / high
    turned = t > TAN_EIGHTH_PI
    if turned:
        t = (low - high) / (low + high)
    z = t * t
    over = z * (P0 + z * (P1 + z * (P2 + z * (P3 + z * P4))))
    under = Q0 + z * (Q1 + z * (Q2 + z * (Q3 + z * (Q4 + z))))
    turn = t + t * (over / under)
    if turned:
        turn = QUARTER_PI + turn
    if y > wide:
        turn = HALF_PI - turn
    return 2.0 * HALF_PI - turn if x < 0.0 else turn


def angles(y: Floats, x: Floats) -> Floats:
    """Return `angle` of arrays, bit for bit, on every processor: NumPy's own differs from one to another."""
    wide = np.abs(x)
    steep = y > wide
    low, high = np.where(steep, wide, y), np.where(steep, y, wide)
    t = np.divide(low, high, out=np.zeros_like(low), where=high != 0.0)
    turn = t > TAN_EIGHTH_PI
    t = np.where(turn, np.divide(low - high, low + high, out=np.zeros_like(low), where=high != 0.0), t)
    z = t * t
    over = z * (P0 + z * (P1 + z * (P2 + z * (P3 + z * P4))))
    under = Q0 + z * (Q1 + z * (Q2 + z * (Q3 + z * (Q4 + z))))
    turned = t + t * (over / under)
    turned = np.where(turn, QUARTER_PI + turned, turned)
    turned = np.where(steep, HALF_PI - turned, turned)
    turned = np.where(x < 0.0, 2.0 * HALF_PI - turned, turned)
    return np.where(high == 0.0, 0.0, turned)
