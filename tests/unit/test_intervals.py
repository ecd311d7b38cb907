"""Intervals of probabilities, against scipy's distributions."""

import sys

import numpy as np
import pytest
from scipy import stats

from dubins_traffic.campaign.report.statistics import clopper_pearson, korn_graubard, wilson, worth
from dubins_traffic.errors import MissingExtraError
from dubins_traffic.falsification.estimate import estimate


@pytest.mark.parametrize(("count", "total"), [(0, 10), (1, 10), (10, 10), (7, 1000), (0, 1_000_000), (999, 1000)])
def test_the_intervals_of_a_share_are_those_of_the_binomial_distribution(count: int, total: int) -> None:
    found = stats.binomtest(count, total)
    exact, score = (found.proportion_ci(0.95, method) for method in ("exact", "wilson"))
    assert clopper_pearson(count, total) == pytest.approx((exact.low, exact.high), rel=1e-9, abs=1e-15)
    assert wilson(count, total) == pytest.approx((score.low, score.high), rel=1e-9, abs=1e-12)


def test_an_estimate_names_the_extra_that_brings_scipy_before_it_runs_a_trial(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "scipy.stats", None)
    told: list[int] = []
    with pytest.raises(MissingExtraError, match=r"install dubins-traffic\[falsify\]"):
        estimate("demo", trials=2, progress=told.append)
    assert told == []


def test_the_interval_of_estimates_is_that_of_as_many_trials_as_vary_as_much() -> None:
    values = [0.0, 0.0, 0.003, 0.001, 0.0]
    mean, variance = np.mean(values), np.var(values, ddof=1) / 5
    trials = mean * (1.0 - mean) / variance
    assert worth(values) == pytest.approx(trials)
    trials *= (stats.norm.ppf(0.975) / stats.t.ppf(0.975, 4)) ** 2
    count = mean * trials
    low = stats.beta.ppf(0.025, count, trials - count + 1.0)
    high = stats.beta.ppf(0.975, count + 1.0, trials - count)
    assert korn_graubard(values) == pytest.approx((low, high), rel=1e-9)
    assert low < mean < high


def test_estimates_that_are_all_alike_have_a_narrow_interval_and_none_at_all_says_nothing() -> None:
    low, high = korn_graubard([0.01] * 10)
    assert 0.00999 < low < 0.01 < high < 0.01001
    assert korn_graubard([0.0, 0.0]) == (0.0, 1.0)


@pytest.mark.parametrize("count", [20, 3])
def test_the_interval_of_few_estimates_of_a_rare_event_holds_the_probability(count: int) -> None:
    """Each of `count` estimates is 0 but for a few in ten, and those differ tenfold: Student's interval would fail."""
    dice = np.random.default_rng(count)
    sizes = np.array([0.001, 0.01])
    held = 0
    for _ in range(1_000):
        values = dice.choice(sizes, count) * (dice.random(count) < 0.5)
        low, high = korn_graubard(values.tolist()) if values.any() else (0.0, 1.0)
        held += low <= 0.5 * sizes.mean() <= high
    assert held >= 950
