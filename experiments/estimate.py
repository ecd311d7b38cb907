"""How well does splitting estimate what is rare: against Monte Carlo at 1e-3, and an event of about 1e-6.

    python -m experiments estimate
    python -m experiments.estimate [RUNS] [TRIALS] [RARE_RUNS]

The event is that a car that wanders gets to the far end of a corridor of crossings, where the ego stands
(`tests.falsifying`): one of three exits at each, so its probability is known. RUNS runs of 200 particles against TRIALS
trials of Monte Carlo on six crossings, and RARE_RUNS runs of 2,500 particles on thirteen.
"""

from __future__ import annotations

import sys

import numpy as np
from benchmarks.table import Row, show
from tests.falsifying import NEAR, corridor, standing

from dubins_traffic.campaign.report.statistics import clopper_pearson
from dubins_traffic.falsification.splitting import Split, split
from dubins_traffic.problem.draw import draw_many

RUNS, TRIALS, RARE_RUNS = 20, 60_000, 10
COMMON, RARE = 6, 13
"""Crossings of the corridors."""
MOST, AWAY, SPREAD = 50_000, 0.3, 0.5
"""The bars: trials of a run, distance from Monte Carlo, coefficient of variation."""


def measure(runs: int = RUNS, trials: int = TRIALS, rare: int = RARE_RUNS) -> list[Row]:
    """Return the rows of this experiment."""
    return [against_monte_carlo(runs, trials), one_in_a_million(rare)]


def once(crossings: int, run: int, particles: int) -> Split:
    """Return what a run of the splitting gives."""
    instances = list(draw_many(corridor(crossings), run, range(particles)))
    return split(instances, standing(), NEAR, [np.random.default_rng(run)])[0]


def against_monte_carlo(runs: int, trials: int) -> Row:
    """Return how far the mean of runs is from what Monte Carlo counts."""
    found = [once(COMMON, run, 200) for run in range(runs)]
    mean, spread = _of([own.probability for own in found])
    happened = 0
    for first in range(0, trials, 500):
        company = standing()(list(draw_many(corridor(COMMON), 9, range(first, min(first + 500, trials)))))
        company.advance(company.group.instances[0].ticks)
        happened += int((company.margins() <= NEAR).sum())
    low, high = clopper_pearson(happened, trials)
    away = abs(mean * trials / max(1, happened) - 1.0)
    told = (
        f"mean {mean:.2e}, variation {spread:.2f} a run of {np.mean([own.trials for own in found]):,.0f} trials; Monte "
        f"Carlo {happened / trials:.2e} ({low:.2e} to {high:.2e}); {away:.0%} apart; known {3.0**-COMMON:.2e}"
    )
    return Row(f"{runs} runs of 200 particles, {trials:,} trials of Monte Carlo", told, f"{AWAY:.0%}", away <= AWAY)


def one_in_a_million(runs: int) -> Row:
    """Return the coefficient of variation of runs on a rare event."""
    found = [once(RARE, run, 2_500) for run in range(runs)]
    mean, spread = _of([own.probability for own in found])
    most = max(own.trials for own in found)
    told = f"mean {mean:.2e}, known {3.0**-RARE:.2e}; variation {spread:.2f}; at most {most:,} trials a run"
    met = spread <= SPREAD and most <= MOST
    return Row(f"{runs} runs of 2,500 particles", told, f"<= {SPREAD}, {MOST:,} trials", met)


def _of(values: list[float]) -> tuple[float, float]:
    """Return the mean and the coefficient of variation."""
    mean = float(np.mean(values))
    return mean, float(np.std(values, ddof=1)) / mean


if __name__ == "__main__":
    raise SystemExit(not show("estimate", measure(*map(int, sys.argv[1:]))))
