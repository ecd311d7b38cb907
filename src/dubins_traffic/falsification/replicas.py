"""What independent runs of splitting say together: the probability, its interval, and whether Monte Carlo is better."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from dubins_traffic.campaign.report.statistics import Interval, clopper_pearson, korn_graubard, worth
from dubins_traffic.falsification.splitting import Split

MONTE_CARLO: Final = "monte-carlo"
SPLITTING: Final = "splitting"
MOST_REPEATED: Final = 0.5


@dataclass(frozen=True, slots=True)
class Replicas:
    """What runs say together.

    Attributes
    ----------
    probability : float
        The mean of their estimates.
    interval : (float, float)
        Its 95 % interval: Korn and Graubard's, from the spread of the estimates. If nothing was branched off, or no run
        got to the event, it is Clopper and Pearson's of the first trials of all runs, which are those of Monte Carlo.
        If most runs did not get there, it reaches around both, since the spread of few says little.
    trials, extinct : int
        How many trials ran; how many runs ended without the event.
    repeated : float
        The share of the branches that came to the same margin as their parents: nothing was left to chance for them.
    worth : float or None
        How many trials of Monte Carlo would have varied as much, p (1 - p) / variance; None if no run got there.
    better : str
        The method with the smaller variance from as many trials.
    advice : tuple of str
        What a user should know of the runs, in sentences.
    """

    probability: float
    interval: Interval
    trials: int
    extinct: int
    repeated: float
    worth: float | None
    better: str
    advice: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Return what a JSON object of the estimate says beyond it."""
        return {
            "extinct": self.extinct, "repeated": self.repeated, "worth": self.worth, "better": self.better,
            "advice": list(self.advice),
        }  # fmt: skip


def combined(runs: Sequence[Split], particles: int) -> Replicas:
    """Return what at least two independent runs of so many particles say together."""
    found = [run.probability for run in runs]
    mean = math.fsum(found) / len(runs)
    trials, branches = sum(run.trials for run in runs), sum(run.branches for run in runs)
    extinct = sum(value == 0.0 for value in found)
    counted = clopper_pearson(sum(run.counted for run in runs), len(runs) * particles)
    # Equal estimates show no spread, which says nothing of it: then Monte Carlo's trials have the word.
    flat = len(set(found)) == 1
    interval = counted if branches == 0 or mean == 0.0 else (mean, mean) if flat else korn_graubard(found)
    if 2 * extinct > len(runs) or flat:
        interval = min(interval[0], counted[0]), max(interval[1], counted[1])
    repeated = sum(run.repeated for run in runs) / branches if branches else 0.0
    equal = trials if branches == 0 or (flat and mean > 0.0) else worth(found) if mean > 0.0 else None
    lost = equal is None or equal <= trials or 2 * extinct > len(runs)
    better = MONTE_CARLO if lost else SPLITTING
    told = Replicas(mean, interval, trials, extinct, repeated, equal, better)
    return replace(told, advice=_advice(told, len(runs), particles))


def _advice(found: Replicas, runs: int, particles: int) -> tuple[str, ...]:
    """Return what a user should know of runs, in sentences."""
    told: list[str] = []
    if found.extinct == runs:
        told.append(
            f"no run got there: that does not say that it can't happen, only that its probability is at most "
            f"{found.interval[1]:.2g} (95 %), by the first {runs * particles} trials"
        )
    elif found.extinct:
        wider = f"; the interval reaches around that of their first {runs * particles} trials"
        told.append(
            f"{found.extinct} of {runs} runs ended without the event{wider if 2 * found.extinct > runs else ''}"
        )
    if found.repeated > MOST_REPEATED:
        told.append(
            f"{found.repeated:.0%} of the trials that were branched off came to the margin of their parents: little is "
            "left to chance where they branch off"
        )
    if found.worth is None:
        bound = clopper_pearson(0, found.trials)[1]
        told.append(
            f"Monte Carlo is better here: {found.trials} trials without the event would bound it by {bound:.2g}"
        )
    elif found.better == MONTE_CARLO:
        told.append(
            f"Monte Carlo is better here: about {found.worth:.0f} trials of it vary as much as these {found.trials}"
        )
    else:
        told.append(f"Monte Carlo would need about {found.worth:.0f} trials to vary as little")
    return tuple(told)
