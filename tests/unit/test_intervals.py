"""Intervals of probabilities, against scipy's distributions."""

import pytest
from scipy import stats

from dubins_traffic.falsification.intervals import clopper_pearson, of_mean, student, wilson


@pytest.mark.parametrize(
    ("count", "total"), [(0, 10), (1, 10), (10, 10), (7, 1000), (0, 1_000_000), (999, 1000)]
)
def test_the_intervals_of_a_share_are_those_of_the_binomial_distribution(count: int, total: int) -> None:
    found = stats.binomtest(count, total)
    exact, score = (found.proportion_ci(0.95, method) for method in ("exact", "wilson"))
    assert clopper_pearson(count, total) == pytest.approx((exact.low, exact.high), rel=1e-9, abs=1e-15)
    assert wilson(count, total) == pytest.approx((score.low, score.high), rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("freedom", [1, 2, 9, 99])
def test_the_quantile_is_that_of_students_distribution(freedom: int) -> None:
    assert student(freedom) == pytest.approx(float(stats.t.ppf(0.975, freedom)), rel=1e-9)


def test_the_interval_of_a_mean_lies_around_it_and_above_nothing() -> None:
    assert of_mean([1.0, 1.0, 1.0]) == (1.0, 1.0)
    low, high = of_mean([0.0, 0.0, 0.3])
    assert low == 0.0
    assert high == pytest.approx(0.1 + student(2) * 0.1)
