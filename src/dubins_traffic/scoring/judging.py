"""Judges a trial by the rules of the road from its frames."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dubins_traffic.cars.state import Frames
from dubins_traffic.problem.instance import Instance
from dubins_traffic.problem.rule_preconditions import check_demands
from dubins_traffic.record.sink import Ending
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.referee import NOTHING
from dubins_traffic.scoring.collisions import Collisions
from dubins_traffic.scoring.duration import ran_whole
from dubins_traffic.scoring.goals import Visiting
from dubins_traffic.scoring.margins import ENTERED, Margins, entries_by_rule
from dubins_traffic.scoring.verdict import Verdict, reach_verdict

if TYPE_CHECKING:
    from dubins_traffic.rules.referee import Breach


class Judging:
    """A sink that judges a trial whose problem carries rules.

    Labels and faults are found again from the poses, so that every trial is judged by this code, whatever recorded it.
    """

    def begin(self, instance: Instance) -> None:
        """Start without a breach.

        Raises
        ------
        InputError
            If the problem asks for the rules and they are not defined on its roads; the message names the place.
        """
        problem = instance.problem
        self._instance = instance
        self._referee = None
        if not problem.rules:
            return
        self._rules = RuleParameters.from_mapping(problem.rules)
        check_demands(
            problem.network,
            problem.intersection_radius,
            problem.car,
            problem.sensing_radius,
            self._rules.to_mapping(),
        )
        from dubins_traffic.rules.referee import Referee  # compiles; only where there is something to judge

        self._referee = Referee([instance])
        self._breaches: list[Breach] = []
        self._sensed = [np.zeros((0, len(instance.names)), dtype=bool)]
        self._visiting = Visiting()
        self._visiting.begin(instance)
        self._collisions = Collisions()
        self._collisions.begin(instance)
        self._margins = Margins()
        self._margins.begin(instance)
        self._ending: Ending | None = None
        self._last = -1

    def frames(self, frames: Frames) -> None:
        """Judge a block of frames."""
        if self._referee is None:
            return
        breaches, contacts = self._referee.judge(frames)
        self._breaches += breaches
        self._collisions.frames(replace(frames, contacts=contacts))
        self._visiting.frames(frames)
        self._margins.frames(frames)
        if len(frames):
            dx, dy = frames.x - frames.x[:, :1], frames.y - frames.y[:, :1]
            radius = self._instance.problem.sensing_radius
            self._sensed.append(dx * dx + dy * dy <= radius * radius)
            self._last = frames.first + len(frames) - 1

    def end(self, ending: Ending) -> None:
        """Keep the ending: only a trial that ran its whole duration can be satisfied."""
        self._ending = ending

    def result(self) -> Verdict | None:
        """Return the verdict up to the last frame, None if the problem carries no rules."""
        if self._referee is None:
            return None
        return reach_verdict(
            self._instance,
            self._rules,
            self._breaches,
            self._collisions.result(),
            self._visiting.result(),
            self._visiting.now,
            self._was_sensed,
            lambda car, tick: self._was_sensed(car, tick, tick),
            self._referee.pending[0] if self._last >= 0 else NOTHING,
            self._margins.result() | self._entries(),
            whole=ran_whole(self._instance, self._ending, self._last),
            by_controller=self._ending is not None and self._ending.by_controller,
        )

    def _entries(self) -> dict[str, float | None]:
        """Return the margins of rule 3."""
        if self._referee is None or self._last < 0:
            return dict.fromkeys(ENTERED)
        return entries_by_rule(self._referee.entries[0], self._instance.problem.period)

    def _was_sensed(self, car: int, first: int, last: int) -> bool:
        if len(self._sensed) > 1:
            self._sensed = [np.concatenate(self._sensed)]
        return bool(self._sensed[0][first : last + 1, car].any())
