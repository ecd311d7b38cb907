"""Trials under way whose least margins are watched, and each of which can go on from another seed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dubins_traffic.controllers.registry import COMPILED
from dubins_traffic.engine.controlled import Controlled, Maker, grouped
from dubins_traffic.engine.group import Group
from dubins_traffic.engine.sharing import can_share, fitness, undisturbed
from dubins_traffic.errors import ControllerError, InputError
from dubins_traffic.falsification.splitting import Begin
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.records import table
from dubins_traffic.rules.judged import distinct_problems
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.scoring.margins_kernel import EgoMargins, MarginTables, find_margins, margin_rules

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

COLUMNS: Final = {"1.road": "road", "2.left": "line", "2.return": "back"}
ENTRIES: Final = {"3.stop": "stop", "3.order": "order", "3.clear": "clear"}
MEASURED: Final = ("1.collision", *COLUMNS, *ENTRIES)
"""The rules whose margins can be watched while a trial runs."""


class Watched:
    """A group of trials and the least margin of one rule that each has had.

    Parameters
    ----------
    group : Group
        The trials; of one control rate.
    rule : str
        One of `MEASURED`.
    """

    def __init__(self, group: Group, rule: str) -> None:
        self.group, self.rule = group, rule

    def margins(self) -> Floats:
        """Return the least margin of each trial up to its present frame, (B,); infinite where nothing was near."""
        world = self.group.world
        if self.rule == "1.collision":
            return np.maximum(world.tally.trial["clearance"], 0.0)
        if self.rule in ENTRIES:
            entries: Any = world.breach_log.entry[ENTRIES[self.rule]]
            return entries * (1.0 if self.rule == "3.clear" else self.group.instances[0].problem.period)
        problems = [instance.problem for instance in self.group.instances]
        kinds, index = distinct_problems(problems)
        rules = [RuleParameters.from_mapping(kind.rules) for kind in kinds]
        found = table(EgoMargins, len(problems))
        tables = MarginTables(
            margin_rules(rules, [kind.period for kind in kinds], index),
            world.roads, world.cars, np.zeros(world.tally.ego.shape[1]),
        )  # fmt: skip
        nets = np.ascontiguousarray(world.tally.trial["net"])
        find_margins(np.arange(len(problems)), self.group.ticks + 1, world.tally.ego, nets, tables, found)
        margins: Any = found[COLUMNS[self.rule]]
        return margins.copy()


class Driven(Watched):
    """Trials that are run by the group itself: its egos keep the rules, or are told nothing and stand."""

    def advance(self, ticks: int) -> None:
        """Take all trials some ticks farther."""
        self.group.advance(ticks)

    def reseeded(self, seeds: Sequence[int]) -> Driven:
        """Return forks of all trials that go on from these seeds."""
        return Driven(self.group.fork(range(len(seeds)), seeds), self.rule)


class Steered(Watched):
    """Trials whose controllers are asked in every tick."""

    def __init__(self, seats: Controlled, rule: str, name: str) -> None:
        super().__init__(seats.group, rule)
        self._seats, self._name = seats, name

    def advance(self, ticks: int) -> None:
        """Take all trials some ticks farther.

        Raises
        ------
        ControllerError
            If one of them ends by a fault: then there is no estimate.
        """
        for _ in range(ticks):
            self._seats.ask_each()
            for outcome in self._seats.step(self._name):
                if outcome.ending.ticks < outcome.instance.ticks:
                    told = f"{outcome.instance.title} ended by a fault ({outcome.ending})"
                    raise ControllerError(outcome.ending.end.value, told)

    def reseeded(self, seeds: Sequence[int]) -> Steered:
        """Return forks of all trials that go on from these seeds."""
        return Steered(self._seats.fork(range(len(seeds)), seeds), self.rule, self._name)


def beginner(make: Maker, name: str, rule: str) -> Begin:
    """Return what begins trials of instances whose egos are driven by controllers that `make` makes.

    Raises
    ------
    InputError
        If the margin of the rule can't be watched.
    """
    if rule not in MEASURED:
        expected = f"one of {', '.join(MEASURED)}"
        raise InputError("has no margin that can be watched", file="--event", value=rule, expected=expected)

    def begin(instances: Sequence[Instance]) -> Driven | Steered:
        check_alike(instances)
        fit = fitness()
        if name == COMPILED and all(fit(own) and undisturbed(own) for own in instances):
            return Driven(Group(instances, keeps_rules=True), rule)
        return Steered(Controlled(instances, make), rule, name)

    return begin


def check_alike(instances: Sequence[Instance]) -> None:
    """Refuse instances that can't be stepped together."""
    if not all(can_share(own) for own in instances) or len(grouped(instances)) != 1:
        raise InputError(
            "trials that can't be stepped together", field="e-agents", value=instances[0].problem.e_agents,
            expected="the embedded simulator, no formulas, no cars of one's own or elsewhere, one control rate",
        )  # fmt: skip
