"""Liveness as what a search looks for: a goal that was not visited for longer than ``gap_rounds`` free-flow rounds.

Of what ``satisfied`` allows that is the part that does not depend on the duration, since cases are cut where they end.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Final

from dubins_traffic.errors import InputError
from dubins_traffic.falsification.contract import CONTRACT, limit_of
from dubins_traffic.protocols import End
from dubins_traffic.record.reader import replay
from dubins_traffic.scoring.judging import Judging
from dubins_traffic.scoring.margins import LIVENESS, SURE
from dubins_traffic.scoring.verdict import EGO_RULES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dubins_traffic.problem.instance import Instance, Problem
    from dubins_traffic.protocols import Ending
    from dubins_traffic.record.reader import Record
    from dubins_traffic.scoring.verdict import Verdict

TARGETS: Final = (*EGO_RULES, LIVENESS, *CONTRACT)
"""What can be asked for by name: the rules, the goals, and the contract."""


@dataclass(frozen=True, slots=True)
class Overdue:
    """A goal that had not been visited since frame `since`, and for too long at frame `tick`."""

    goal: tuple[float, float]
    since: int
    tick: int


def spare(problem: Problem, verdict: Verdict, ending: Ending | None) -> float | None:
    """Return by how many seconds the longest gap of a goal stayed below its limit; negative exactly if it did not.

    None without goals, and of a trial that did not run its whole duration: what would have come is not known.
    """
    limit, gap = limit_of(problem), verdict.longest_gap_s
    if limit is None or gap is None or ending is None or ending.end is not End.DURATION:
        return None
    return min(limit - gap, -SURE) if gap > limit else max(limit - gap, SURE)


def first_overdue(record: Record, limit: float) -> Overdue | None:
    """Return the first goal of a trial that was not visited for more than `limit` seconds, None if there is none."""
    judging = Judging()
    replay(record, [judging])
    rate, final = record.frames.rate, len(record.frames) - 1
    allowed = int(limit * rate)
    while (allowed + 1) / rate <= limit:
        allowed += 1
    over: list[tuple[int, int, int]] = []
    goals = tuple(dict.fromkeys(record.instance.problem.goals))
    for goal in range(len(goals)):
        ticks = [0, *(tick for tick, which in judging.visits if which == goal), final]
        over += [
            (since + allowed + 1, goal, since) for since, tick in pairwise(ticks) if tick - since > allowed
        ]
    if not over:
        return None
    tick, goal, since = min(over)
    return Overdue(goals[goal], since, tick)


def check_long_enough(instances: Sequence[Instance], target: str) -> None:
    """Refuse trials none of which lasts as long as a gap may; `target` is what is asked for.

    Raises
    ------
    InputError
        If there is none, or they have no goals.
    """
    limits = [limit_of(own.problem) for own in instances]
    least = min([limit for limit in limits if limit is not None], default=None)
    if least is None:
        raise InputError("has no goals that can be visited", file="--rule", value=target)
    longest = max(own.duration for own in instances)
    if longest <= least:
        raise InputError(
            "no gap between visits can be over its limit in trials so short", file="--duration", value=longest,
            expected=f"more than {least:.1f} s, or a smaller gap_rounds among the rules",
        )  # fmt: skip
