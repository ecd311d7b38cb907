"""Means, medians, shares and probabilities with their 95 % intervals.

Means with their bootstrap intervals, and shares with Wilson's, need no SciPy: a service ranks by these alone. Quantiles
of other distributions than the normal one are SciPy's.

Sources: E. Wilson, Journal of the American Statistical Association 22, 1927; C. Clopper and E. Pearson, Biometrika 26,
1934; B. Efron, Annals of Statistics 7, 1979; E. Korn and B. Graubard, Survey Methodology 24, 1998.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib import import_module
from typing import Any, TypeAlias

import numpy as np

from dubins_traffic.errors import needs
from dubins_traffic.kernels.arrays import Floats, Ints

LEVEL = 0.95
RESAMPLES = 1_000
SEED = 2016
NORMAL = 1.959963984540054
"""The normal distribution has `LEVEL` of its weight within so many standard deviations of its mean."""
MOST = 2_000
"""Of more values than these the interval follows from the normal and the binomial distribution."""
MOST_WORTH = 1e9

Interval: TypeAlias = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Estimate:
    """Mean and median of `count` values, each with its 95 % interval; None where there are no values."""

    count: int
    mean: float | None
    mean_interval: Interval | None
    median: float | None
    median_interval: Interval | None


@dataclass(frozen=True, slots=True)
class Share:
    """How many of `total` trials, as a share with its 95 % interval (Wilson's)."""

    count: int
    total: int
    share: float | None
    interval: Interval | None


def estimate(values: Floats, *, median: bool = True) -> Estimate:
    """Return the estimates for values, NaN among them left out; without `median` of the mean alone.

    The intervals are percentiles of 1,000 bootstrap resamples from a fixed seed; beyond `MOST` values that of the mean
    is its normal one, and the median lies between order statistics.
    """
    known = values[~np.isnan(values)]
    count = len(known)
    if count == 0:
        return Estimate(0, None, None, None, None)
    mean = math.fsum(known.tolist()) / count
    resamples = None if count > MOST else known[_drawn(count)]
    if count == 1 or float(known.min()) == float(known.max()):
        about = (mean, mean)
    else:
        about = _normal(known, mean) if resamples is None else _between(resamples.mean(axis=-1))
    if not median:
        return Estimate(count, mean, about, None, None)
    middle = float(np.median(known))
    between = _ranks(known) if resamples is None else _between(np.median(resamples, axis=-1))
    return Estimate(count, mean, about, middle, between)


def is_decided(interval: Interval) -> bool:
    """Tell whether the interval of a difference leaves out 0."""
    return interval[0] > 0 or interval[1] < 0


def apart(first: Floats, second: Floats) -> tuple[float | None, Interval | None]:
    """Return how much the mean of independent values exceeds that of others, with its 95 % interval; NaN are left out.

    The interval holds percentiles of 1,000 bootstrap resamples of both; beyond `MOST` values it is the normal one.
    """
    one, other = (values[~np.isnan(values)] for values in (first, second))
    if not len(one) or not len(other):
        return None, None
    mean = float(other.mean() - one.mean())
    if max(len(one), len(other)) > MOST:
        half = NORMAL * math.sqrt(sum(float(values.var()) / len(values) for values in (one, other)))
        return mean, (mean - half, mean + half)
    draws = np.random.default_rng(SEED)
    resampled = [
        values[draws.integers(0, len(values), (RESAMPLES, len(values)))].mean(axis=-1) for values in (one, other)
    ]
    return mean, _between(resampled[1] - resampled[0])


def share(count: int, total: int) -> Share:
    """Return a share of trials."""
    return Share(count, total, count / total, wilson(count, total)) if total else Share(count, total, None, None)


def wilson(count: int, total: int) -> Interval:
    """Return Wilson's 95 % interval of a probability: an event happened in `count` of `total` trials, at least one."""
    part, square = count / total, NORMAL**2
    around = 2.0 * (total + square)
    middle = (2.0 * total * part + square) / around
    half = NORMAL / around * math.sqrt(4.0 * total * part * (1.0 - part) + square)
    return (0.0 if count == 0 else middle - half, 1.0 if count == total else middle + half)


def clopper_pearson(count: float, total: float) -> Interval:
    """Return the exact 95 % interval, which holds the probability in at least 95 of 100 cases."""
    beta, tail = distributions("an estimate of a probability", "falsify").beta, (1.0 - LEVEL) / 2.0
    low = 0.0 if count == 0 else float(beta.ppf(tail, count, total - count + 1))
    return low, 1.0 if count == total else float(beta.ppf(1.0 - tail, count + 1, total - count))


def korn_graubard(values: Sequence[float]) -> Interval:
    """Return the 95 % interval of a probability from independent estimates of it without bias, at least two.

    It is Clopper and Pearson's for as many trials of Monte Carlo as would vary as much as the mean (`worth`), fewer
    where the spread itself is known from few estimates: so it is as skew as a count of few, unlike Student's.
    """
    mean = math.fsum(values) / len(values)
    if mean <= 0.0 or mean >= 1.0:
        return (0.0, 1.0)
    student = distributions("an estimate of a probability", "falsify").t.ppf(0.5 + 0.5 * LEVEL, len(values) - 1)
    total = worth(values) * (NORMAL / float(student)) ** 2
    return clopper_pearson(mean * total, total)


def worth(values: Sequence[float]) -> float:
    """Return how many trials of Monte Carlo would vary as much as the mean of independent estimates of a probability.

    The mean must be above 0; at least two estimates. They are `MOST_WORTH` at most.
    """
    count = len(values)
    mean = math.fsum(values) / count
    variance = math.fsum((value - mean) ** 2 for value in values) / (count - 1) / count
    return min(MOST_WORTH, mean * (1.0 - mean) / variance) if variance > 0.0 else MOST_WORTH


def distributions(feature: str = "a report", extra: str = "campaign") -> Any:
    """Return scipy.stats; MissingExtraError names what needs it, and the extra that brings it."""
    with needs(feature, extra):
        return import_module("scipy.stats")


@lru_cache(maxsize=4)
def _drawn(count: int) -> Ints:
    """Return which of `count` values, `MOST` at most, make up each resample: the same for all that are as many."""
    return np.random.default_rng(SEED).integers(0, count, (RESAMPLES, count))


def _between(resampled: Floats) -> Interval:
    """Return the interval between the percentiles of what was found of each resample."""
    ordered: list[float] = np.sort(resampled).tolist()
    tail = (1.0 - LEVEL) / 2.0
    return _quantile(ordered, tail), _quantile(ordered, 1.0 - tail)


def _quantile(ordered: Sequence[float], part: float) -> float:
    """Return the value below which a part of the values lies, between two of them by their distance.

    NumPy's goes from the nearer of the two, which gives another last bit in a quarter of all cases.
    """
    place = part * len(ordered) + (1.0 - part)
    first = max(1, min(int(place), len(ordered) - 1))
    beyond = place - first
    return (1.0 - beyond) * ordered[first - 1] + beyond * ordered[first]


def _normal(values: Floats, mean: float) -> Interval:
    half = NORMAL * float(values.std(ddof=1)) / math.sqrt(len(values))
    return mean - half, mean + half


def _ranks(values: Floats) -> Interval:
    """Return the order statistics between which the median lies: their ranks are quantiles of a binomial."""
    ordered = np.sort(values)
    ranks: Any = distributions().binom.ppf([0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL], len(values), 0.5)
    return float(ordered[int(ranks[0])]), float(ordered[int(ranks[1])])
