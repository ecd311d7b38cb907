"""Intervals of means and shares: those that SciPy gives, without it."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
import scipy.stats

from dubins_traffic.campaign.report.statistics import LEVEL, MOST, NORMAL, RESAMPLES, SEED, estimate, share


@pytest.mark.parametrize(("count", "values"), [(2, 3), (7, 3), (100, 5), (1999, 40)])
def test_the_interval_of_a_mean_and_a_median_is_a_bootstrap_s(count: int, values: int) -> None:
    for seed in range(5):
        draws = np.random.default_rng(seed)
        known = draws.integers(0, values, count).astype(float) if seed % 2 else draws.normal(size=count)
        known[0] += 1.0  # not all alike
        found = estimate(known)
        for statistic, own in ((np.mean, found.mean_interval), (np.median, found.median_interval)):
            theirs = scipy.stats.bootstrap(
                (known,),
                statistic,
                n_resamples=RESAMPLES,
                batch=max(1, 4_000_000 // count),
                confidence_level=LEVEL,
                method="percentile",
                random_state=np.random.default_rng(SEED),
            ).confidence_interval
            assert own == pytest.approx((theirs.low, theirs.high), rel=1e-12, abs=1e-12)


def test_the_interval_of_very_many_values_is_the_normal_one() -> None:
    known = np.random.default_rng(1).normal(size=MOST + 1)
    half = scipy.stats.norm.ppf(0.5 + 0.5 * LEVEL) * known.std(ddof=1) / np.sqrt(len(known))
    found = estimate(known, median=False)
    assert found.mean is not None
    assert found.mean_interval == pytest.approx((found.mean - half, found.mean + half), rel=1e-12)
    assert pytest.approx(scipy.stats.norm.ppf(0.5 + 0.5 * LEVEL), rel=1e-15) == NORMAL


@pytest.mark.parametrize("total", [1, 3, 20, 100_000])
def test_the_interval_of_a_share_is_wilson_s(total: int) -> None:
    for count in sorted({0, 1, total // 3, total - 1, total}):
        theirs = scipy.stats.binomtest(count, total).proportion_ci(LEVEL, method="wilson")
        assert share(count, total).interval == pytest.approx((theirs.low, theirs.high), rel=1e-12)


def test_a_table_is_made_without_scipy() -> None:
    """A service ranks by these alone: the extra `service` need not bring SciPy."""
    code = (
        "import sys; sys.modules['scipy'] = None\n"
        "from tests.competitions import competition, results\n"
        "from dubins_traffic.competition.ranking import rank\n"
        "phase = competition().phase('practice')\n"
        "places = rank({'a': results([3, 1, 2, 5, 4, 2]), 'b': results([0, 1, 0, 2, 0, 1])}, phase)\n"
        "print([own.place for own in places], places[0].to_json()['interval'])"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.startswith("[1, 2] [")
