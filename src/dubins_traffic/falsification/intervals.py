"""Confidence intervals of a probability: Wilson's, Clopper and Pearson's, and of the mean of a few estimates.

Sources: E. Wilson, Journal of the American Statistical Association 22, 1927; C. Clopper and E. Pearson, Biometrika 26,
1934; E. Korn and B. Graubard, Survey Methodology 24, 1998; the incomplete beta function by its continued fraction (W.
Lentz, Applied Optics 15, 1976).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final

Interval = tuple[float, float]
NORMAL: Final = 1.959963984540054
"""The normal distribution has 95 % of its weight within so many standard deviations."""
TAIL: Final = 0.025
MOST_WORTH: Final = 1e9
HALVINGS: Final = 200


def wilson(count: int, total: int) -> Interval:
    """Return Wilson's 95 % interval of a probability of which `count` of `total` trials tell."""
    square = NORMAL * NORMAL
    around = 2.0 * (total + square)
    share = count / total
    middle = (2.0 * count + square) / around
    half = NORMAL / around * math.sqrt(4.0 * count * (1.0 - share) + square)
    return (0.0 if count == 0 else middle - half, 1.0 if count == total else middle + half)


def clopper_pearson(count: float, total: float) -> Interval:
    """Return the exact 95 % interval, which holds the probability in at least 95 of 100 cases."""
    low = 0.0 if count == 0 else _solve(lambda p: incomplete_beta(count, total - count + 1, p), TAIL)
    high = (
        1.0 if count == total else _solve(lambda p: incomplete_beta(count + 1, total - count, p), 1.0 - TAIL)
    )
    return low, high


def korn_graubard(values: Sequence[float]) -> Interval:
    """Return the 95 % interval of a probability from independent estimates of it without bias, at least two.

    It is Clopper and Pearson's for as many trials of Monte Carlo as would vary as much as the mean (`worth`), fewer
    where the spread itself is known from few estimates: so it is as skew as a count of few, unlike Student's.
    """
    mean = math.fsum(values) / len(values)
    if mean <= 0.0 or mean >= 1.0:
        return (0.0, 1.0)
    total = worth(values) * (NORMAL / student(len(values) - 1)) ** 2
    return clopper_pearson(mean * total, total)


def worth(values: Sequence[float]) -> float:
    """Return how many trials of Monte Carlo would vary as much as the mean of independent estimates of a probability.

    The mean must be above 0; at least two estimates. They are `MOST_WORTH` at most.
    """
    count = len(values)
    mean = math.fsum(values) / count
    variance = math.fsum((value - mean) ** 2 for value in values) / (count - 1) / count
    return min(MOST_WORTH, mean * (1.0 - mean) / variance) if variance > 0.0 else MOST_WORTH


def student(freedom: int) -> float:
    """Return the value that Student's distribution with so many degrees of freedom exceeds with probability 0.025."""
    share = _solve(lambda x: incomplete_beta(freedom / 2.0, 0.5, x), 2.0 * TAIL)
    return math.sqrt(freedom * (1.0 - share) / share)


def incomplete_beta(a: float, b: float, x: float) -> float:
    """Return the regularised incomplete beta function of x in [0, 1]."""
    if x <= 0.0 or x >= 1.0:
        return min(1.0, max(0.0, x))
    front = math.exp(
        math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b) + a * math.log(x) + b * math.log1p(-x)
    )
    if x < (a + 1.0) / (a + b + 2.0):
        return front * _fraction(a, b, x) / a
    return 1.0 - front * _fraction(b, a, 1.0 - x) / b


def _fraction(a: float, b: float, x: float) -> float:
    """Return the continued fraction of the incomplete beta function."""
    tiny = 1e-300
    c, d = 1.0, 1.0 - (a + b) * x / (a + 1.0)
    d = 1.0 / (d if abs(d) > tiny else tiny)
    value = d
    for m in range(1, 10_000):
        for step in (
            m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m)),
            -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1)),
        ):
            d = 1.0 + step * d
            d = 1.0 / (d if abs(d) > tiny else tiny)
            c = 1.0 + step / c
            c = c if abs(c) > tiny else tiny
            value *= c * d
        if abs(c * d - 1.0) < 1e-15:
            break
    return value


def _solve(rising: Callable[[float], float], wanted: float) -> float:
    """Return where a function that rises over [0, 1] takes a value, by halving."""
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        if rising(middle) < wanted:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)
