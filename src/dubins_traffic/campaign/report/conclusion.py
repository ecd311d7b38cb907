"""What a report says first: which controller is best and by how much, and which can't be told apart."""

from __future__ import annotations

from itertools import combinations

from dubins_traffic.campaign.report.comparison import (
    RANKING,
    Comparison,
    Difference,
    Standing,
    number_of,
    shown,
)
from dubins_traffic.scoring.metric import Column

FEWEST = 6
"""From fewer pairs of trials nothing is told apart: of equals, all of five pairs go one way once in 16 times."""
MOST_PAIRS = 3
"""So many pairs that can't be told apart are named; of more it is said how many there are."""


def conclusion(comparison: Comparison) -> str:
    """Return one to three sentences on the controllers of a campaign, by what ranks them (`RANKING`).

    Two controllers are told apart in a column if the 95 % interval of their difference on the same instances leaves
    out 0.
    """
    best, *others = comparison.standings
    if not others:
        return _alone(best)
    leading, next_one = comparison.controllers[:2]
    open_pairs = [pair for pair in combinations(comparison.controllers, 2) if not _told(comparison, *pair)]
    rest = [f"{one} and {other}" for one, other in open_pairs if (one, other) != (leading, next_one)]
    said = [_best(comparison, best, next_one)]
    if rest:
        more = f", and {len(rest) - MOST_PAIRS} more pairs" if len(rest) > MOST_PAIRS else ""
        said.append(f"These can't be told apart{' either' if len(open_pairs) > len(rest) else ''}: "
                    f"{'; '.join(rest[:MOST_PAIRS])}{more}.")  # fmt: skip
    return " ".join(said)


def is_told(one: Difference) -> bool:
    """Tell whether trials tell two controllers apart in a metric."""
    return one.estimate.count >= FEWEST and one.is_decided


def more_than(one: Difference, whom: str) -> str:
    """Say how much the first of two controllers exceeds the second, called `whom`, with the interval."""
    mean, ends = one.estimate.mean or 0.0, one.estimate.mean_interval or (0.0, 0.0)
    less = mean < 0
    low, high = (-ends[1], -ends[0]) if less else ends
    words = "fewer" if less else "more"
    return f"{shown(abs(mean))} {words} than {whom} (95 % interval {shown(low)} to {shown(high)})"


def _alone(standing: Standing) -> str:
    metric = RANKING[0]
    estimate = standing.estimates.get(metric.name)
    ends = None if estimate is None else estimate.mean_interval
    interval = "" if ends is None else f" (95 % interval {shown(ends[0])} to {shown(ends[1])})"
    return f"{standing.controller} has {_mean(standing, metric)} {metric.label} a trial{interval}."


def _best(comparison: Comparison, best: Standing, other: str) -> str:
    """Say whether the first controller is better than the next, and by what."""
    whom = other if len(comparison.controllers) == 2 else f"{other}, the next"
    merits = _merits(comparison, best.controller, other)
    count = merits[0].estimate.count
    if count < FEWEST:
        pairs = f"{number_of(count, 'pair')} of trials"
        return f"{pairs} can't tell whether {best.controller} or {other} is better; it takes {FEWEST} or more."
    rounds, before = RANKING
    for merit in merits:
        if is_told(merit) and merit.better == best.controller:
            mean, more = _mean(best, merit.metric), more_than(merit, whom)
            nobody = _mean(best, rounds) == shown(0.0)
            first = "No trial has a counted round. " if merit.metric is before and nobody else ""
            return f"{first}{best.controller} is best: {mean} {merit.metric.label} a trial, {more}."
    mean, more = _mean(best, rounds), more_than(merits[0], whom)
    return f"Which is best can't be told: {best.controller} has {mean} {rounds.label} a trial, {more}."


def _told(comparison: Comparison, first: str, second: str) -> bool:
    return any(map(is_told, _merits(comparison, first, second)))


def _merits(comparison: Comparison, first: str, second: str) -> list[Difference]:
    """Return the differences of two controllers in the columns that rank, in their order."""
    return [one for one in comparison.merits if (one.first, one.second) == (first, second)]


def _mean(standing: Standing, metric: Column) -> str:
    """Return the mean of a column over all trials; one that came to nothing counts 0."""
    estimate = standing.estimates.get(metric.name)
    mean = 0.0 if estimate is None or estimate.mean is None else estimate.mean * estimate.count
    return shown(mean / max(1, standing.trials))
