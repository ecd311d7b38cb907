"""Trials under way whose least margins are watched, and each of which can go on from another seed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dubins_traffic.engine.controlled import Maker
from dubins_traffic.engine.egos import Egos, Way, can_share, grouped
from dubins_traffic.engine.group import Group
from dubins_traffic.errors import ControllerError, InputError
from dubins_traffic.falsification.splitting import Begin
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.record.sink import FAULTS

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

COLUMNS: Final = {"1.road": "road", "2.left": "line", "2.return": "back", "2.turn": "turn"}
ENTRIES: Final = {"3.stop": "stop", "3.order": "order", "3.clear": "clear"}
MEASURED: Final = ("1.collision", *COLUMNS, *ENTRIES)
"""The rules whose margins can be watched while a trial runs."""
AHEAD: Final = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 2.5, 3.0)
"""Seconds by which a level looks ahead."""
HASTE: Final = 0.05
"""Metres by which a gap counts as wider for each second until then."""


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
        margins: Any = self.group.margins(np.arange(len(self.group.instances)))[COLUMNS[self.rule]]
        return margins.copy()

    def levels(self) -> Floats:
        """Return how near each trial is to a breach, or was, (B,): its margin, of `1.collision` the one to come too."""
        margins = self.margins()
        return margins if self.rule != "1.collision" else np.minimum(margins, coming(self.group))

    def advance(self, ticks: int) -> None:
        """Take all trials some ticks farther.

        Raises
        ------
        ControllerError
            If one of them ends by a fault: then there is no estimate.
        """
        self.group.drive(ticks)
        for instance, ending in zip(self.group.instances, self.group.endings, strict=True):
            if ending is not None and ending.end in FAULTS:
                raise ControllerError(ending.end.value, f"{instance.title} ended by a fault ({ending})")

    def fork(self, trials: Sequence[int]) -> Watched:
        """Return independent copies of some trials, each with a copy of its controller."""
        return Watched(self.group.fork(trials), self.rule)

    def reseed(self, seeds: Sequence[int]) -> None:
        """Let each trial go on from another seed."""
        self.group = self.group.reseeded(seeds)


def coming(group: Group) -> Floats:
    """Return the clearance to come of each trial's ego, (B,): infinite where it is alone.

    It is the least, over the next `AHEAD` seconds at present speeds and headings, of the gap between the discs around
    the ego and another car, and of `HASTE` metres for each second until then: what is far off counts as less near.
    """
    state, reach = group.state, group.world.cars.reach
    x, y = (array[:, 1:] - array[:, :1] for array in (state.x, state.y))
    vx, vy = (own[:, 1:] - own[:, :1] for own in (state.speed * state.c, state.speed * state.s))
    places: int = state.x.shape[1]
    absent = np.arange(1, places) >= state.count[:, None]
    least = np.full(len(x), np.inf)
    for later in AHEAD:
        dx, dy = x + later * vx, y + later * vy
        gap = np.sqrt(dx * dx + dy * dy) - 2.0 * reach[:, None]
        gap[absent] = np.inf
        least = np.minimum(least, np.maximum(gap, 0.0).min(axis=1, initial=np.inf) + HASTE * later)
    return least


def beginner(controller: str | Maker, rule: str) -> Begin:
    """Return what begins trials of instances whose egos a controller drives.

    Raises
    ------
    InputError
        If the margin of the rule can't be watched.
    """
    if rule not in MEASURED:
        expected = f"one of {', '.join(MEASURED)}"
        raise InputError("has no margin that can be watched", file="--event", value=rule, expected=expected)
    egos = Egos(controller, apart=True)

    def begin(instances: Sequence[Instance]) -> Watched:
        ways = egos.ways(instances)
        if not all(map(can_share, instances)) or len(grouped(instances)) != 1:
            raise InputError(
                "trials that can't be stepped together", field="e-agents", value=instances[0].problem.e_agents,
                expected="the embedded simulator, no formulas, no cars of one's own or elsewhere, one control rate",
            )  # fmt: skip
        way = Way.COMPILED if len(ways[Way.COMPILED]) == len(instances) else Way.ASKED
        return Watched(egos.group(instances, way), rule)

    return begin
