"""Sines and cosines without a mathematical library: plain functions, compiled in `kernels.trig`."""

from __future__ import annotations

from math import factorial

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
