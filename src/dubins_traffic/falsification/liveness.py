"""Liveness as what a search looks for: a goal that was not visited for longer than ``gap_rounds`` free-flow rounds.

Of what ``satisfied`` allows that is the part that does not depend on the duration, since cases are cut where they end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from dubins_traffic.errors import InputError
from dubins_traffic.protocols import End
from dubins_traffic.record.reader import replay
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.scoring.gap_limit import rounds_limit
from dubins_traffic.scoring.goals import Visiting
from dubins_traffic.scoring.margins import LIVENESS, SURE
from dubins_traffic.scoring.verdict import EGO_RULES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dubins_traffic.kernels.arrays import Ints
    from dubins_traffic.problem.instance import Instance, Problem
    from dubins_traffic.protocols import Ending
    from dubins_traffic.record.reader import Record
    from dubins_traffic.scoring.verdict import Verdict

TARGETS: Final = (*EGO_RULES, LIVENESS)
"""What can be asked for by name: the rules, and the goals."""


@dataclass(frozen=True, slots=True)
class Overdue:
    """A goal that had not been visited since frame `since`, and for too long at frame `tick`."""

    goal: tuple[float, float]
    since: int
    tick: int


def limit_of(problem: Problem) -> float | None:
    """Return the longest gap that is none to look for, seconds; None if no round goes through all goals."""
    limit = rounds_limit(problem, RuleParameters.from_mapping(problem.rules))
    return limit if math.isfinite(limit) else None


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
    visits = _Visits(limit, record.frames.rate)
    replay(record, [visits])
    return visits.found()


def check_long_enough(instances: Sequence[Instance]) -> None:
    """Refuse trials none of which lasts as long as a gap may.

    Raises
    ------
    InputError
        If there is none, or they have no goals.
    """
    limits = [limit_of(own.problem) for own in instances]
    least = min([limit for limit in limits if limit is not None], default=None)
    if least is None:
        raise InputError("has no goals that can be visited", file="--rule", value=LIVENESS)
    longest = max(own.duration for own in instances)
    if longest <= least:
        raise InputError(
            "no gap between visits can be over its limit in trials so short", file="--duration", value=longest,
            expected=f"more than {least:.1f} s, or a smaller gap_rounds among the rules",
        )  # fmt: skip


class _Visits(Visiting):
    """Visits, with the first gap that is longer than `limit` seconds at `rate` Hz."""

    def __init__(self, limit: float, rate: float) -> None:
        self._allowed = int(limit * rate)
        while (self._allowed + 1) / rate <= limit:
            self._allowed += 1
        self._over: list[tuple[int, int, int]] = []

    def _visit(self, goal: int, tick: int, elsewhere: Ints) -> bool:
        before = int(self._last[goal])
        counts = super()._visit(goal, tick, elsewhere)
        if counts:
            self._note(goal, before, tick)
        return counts

    def _note(self, goal: int, since: int, tick: int) -> None:
        if tick - since > self._allowed:
            self._over.append((since + self._allowed + 1, goal, since))

    def found(self) -> Overdue | None:
        """Return the first goal that was overdue."""
        for goal, since in enumerate(self._last.tolist()):
            self._note(goal, since, self._last_frame)
        if not self._over:
            return None
        tick, goal, since = min(self._over)
        return Overdue(self._discs.goals[goal], since, tick)
