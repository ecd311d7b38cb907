"""What stands under a table of scores: which breaches cost the ego most, and how to look at the first of them."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from dubins_traffic.scoring.score import Score, ScoreSheet


class Cost(NamedTuple):
    """A breach of the ego, or where no rules are judged a collision: `what`, in which trial, at which second."""

    what: str
    score: Score
    time: float


def costs_of(score: Score) -> Iterator[Cost]:
    """Yield what a trial cost its ego, in order of time."""
    if score.verdict is not None:
        for breach in score.verdict.own_violations:
            yield Cost(breach.rule, score, breach.time)
    else:
        for collision in score.collisions:
            yield Cost("a collision", score, collision.time)


def worst(sheet: ScoreSheet) -> list[str]:
    """Return lines that say what happened most often and where to look; none if nothing did, or of several controllers.

    Of what happened equally often, that which happened first is told.
    """
    if len({score.controller for score in sheet.trials}) > 1:
        return []
    costs = [cost for score in sheet.trials for cost in costs_of(score)]
    if not costs:
        return []
    what, number = Counter(cost.what for cost in costs).most_common(1)[0]
    first = next(cost for cost in costs if cost.what == what)
    often = "once" if number == 1 else f"{number} times"
    where = f"trial {first.score.trial} at {first.time:.2f} s"
    said = f"Cost most: {what}, {often}, {'in' if number == 1 else 'first in'} {where}."
    if first.score.record is None:
        return [said, "The option --records DIR keeps the trials, so that you can look at them."]
    begin = max(0.0, first.time - 1.0)
    return [said, f"To see it: dubins-traffic replay {shlex.quote(first.score.record)} --at {begin:.2f}"]
