"""What has been counted and judged of a trial: the same live, in a batch and from a record."""

from __future__ import annotations

import math
from collections.abc import Sequence, Set
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dubins_traffic.cars.state import Contact
from dubins_traffic.record.sink import Ending
from dubins_traffic.rules.breach_log import EntryMargins
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.referee import Breach, Pending
from dubins_traffic.scoring.collisions import Collision
from dubins_traffic.scoring.counts import GoalCounts, TrialCounts, ran_whole
from dubins_traffic.scoring.goals import Visits, visits_of
from dubins_traffic.scoring.margins import EgoMargins, entries_by_rule, margins_by_rule
from dubins_traffic.scoring.tally import Tally
from dubins_traffic.scoring.verdict import Verdict, reach_verdict

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance


@dataclass(frozen=True, slots=True)
class Findings:
    """What has been found of one trial up to its frame `last`, -1 before the first.

    Attributes
    ----------
    instance, rules
        The instance that was run, and the parameters of its rules.
    ending, last
        How the trial ended, None while it runs and for a record that was cut off; its last frame.
    tally, row
        The counts, and the trial's row in them.
    contacts, breaches
        Those of the trial in order of time: contacts with `at_fault`, breaches with those that contacts are.
    seen
        (car, tick) of each breach by an e-agent that was within the sensing radius then.
    running
        The pending obligations after the last frame.
    margins, entry
        The margins of rules 1 and 2, and of rule 3.
    """

    instance: Instance
    rules: RuleParameters
    ending: Ending | None
    last: int
    tally: Tally
    row: int
    contacts: Sequence[Contact]
    breaches: Sequence[Breach]
    seen: Set[tuple[int, int]]
    running: Pending
    margins: EgoMargins
    entry: EntryMargins

    @property
    def counts(self) -> TrialCounts:
        """The counts of the trial."""
        return self.tally.trial[self.row]

    @property
    def goals(self) -> list[GoalCounts]:
        """The counts of its goals, each once."""
        return [self.tally.goal[g] for g in range(self.counts.first_goal, self.counts.last_goal)]

    @property
    def whole(self) -> bool:
        """Whether it ran its whole planned duration."""
        return ran_whole(self.instance, self.ending, self.last)

    @property
    def gap(self) -> float | None:
        """The smallest gap between the ego and another body, metres; None if there is none."""
        clearance = self.counts.clearance
        return None if math.isinf(clearance) else max(0.0, clearance)

    @property
    def visits(self) -> Visits:
        """The visits of its goals."""
        return visits_of(self.instance, self.goals, self.tally.rounds[self.row].rounds, self.last)

    def verdict(self, visits: Visits, collisions: tuple[Collision, ...]) -> Verdict | None:
        """Return the verdict, None if the problem carries no rules; `visits` and `collisions` are those found."""
        if not self.instance.problem.rules:
            return None
        margins, sensed = self.margins, self.tally.sensed[self.row]
        return reach_verdict(
            self.instance,
            self.rules,
            self.breaches,
            collisions,
            visits,
            [goal.visits > 0 and goal.last_visit == self.last for goal in self.goals],
            lambda car, first, last: bool(first <= sensed[car] <= last),
            lambda car, tick: (car, tick) in self.seen,
            self.running,
            margins_by_rule(self.gap, (margins.road, margins.line, margins.back, margins.turn))
            | entries_by_rule(self.entry, self.instance.problem.period),
            whole=self.whole,
            end=None if self.ending is None else self.ending.end.value,
        )
