"""Margins: by how much the ego keeps or breaks each rule."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Final, Protocol

import numpy as np

from dubins_traffic.cars.state import EGO, Frames
from dubins_traffic.cars.tables import pack_cars
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.records import table
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.sink import Ending
from dubins_traffic.roads.table import pack
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.scoring.clearance import Clearance
from dubins_traffic.scoring.verdict import EGO_NAME, Verdict

if TYPE_CHECKING:
    from dubins_traffic.rules.breach_log import EntryMargins

MEASURED: Final = ("1.road", "2.left", "2.return", "2.turn")
"""The rules whose margins `find_margins` finds, in the order of `EgoMargins`."""
ENTERED: Final = ("3.stop", "3.order", "3.clear")
"""The rules whose margins the referee finds, in the order of `rules.breach_log.EntryMargins`."""
LIVENESS: Final = "1.goal"
MARGINS: Final = ("1.collision", *MEASURED, *ENTERED, LIVENESS)
"""The columns of `margins_of`."""
UNITS: Final = {"3.stop": "s", "3.order": "s", LIVENESS: "s"}
"""Units of the margins that are not in metres."""
SURE: Final = 1e-9
"""Least absolute value of a margin in `margins_of`, with the sign of the verdict."""


class Judged(Protocol):
    """What `margins_of` reads of a score (`scoring.score.Score`)."""

    @property
    def verdict(self) -> Verdict | None:
        """The verdict, None if the problem carries no rules."""
        ...

    @property
    def goals_visited(self) -> float:
        """Share of the goals that were visited."""
        ...


class Margins:
    """The robustness of the ego's rules 1 and 2 (`logic.robustness`), in metres.

    The signals are the gap to the nearest other body, the distance of the centre to the edge of the road, and how far
    the body reaches beyond the line at which `left` rises (or, once it has risen, falls); `overtaking` and `hemmed` are
    infinite; that of `turned` is how much farther the ego could have backed. The robustness of
    ``[] (left -> overtaking)`` is the least margin to the line while the ego does not overtake, that of
    ``[] (left -> <>[0,d] (!left | hemmed))`` the least of the greatest margins within d.
    """

    def begin(self, instance: Instance) -> None:
        """Start without a frame."""
        self._problem = instance.problem
        self._clearance = Clearance()
        self._clearance.begin(instance)
        self._blocks: list[Frames] = []

    def frames(self, frames: Frames) -> None:
        """Take a block of frames."""
        self._clearance.frames(frames)
        self._blocks.append(frames)

    def end(self, ending: Ending) -> None:
        """Nothing is left to do."""

    def result(self) -> dict[str, float | None]:
        """Return the robustness of rules 1 and 2 by their names, metres; None where nothing could break them.

        It is positive if the rule was kept and negative if it was broken, or would be if the trial ended here.
        """
        gap = self._clearance.result()
        count = sum(map(len, self._blocks))
        if not count:
            return margins_by_rule(gap, [math.inf] * len(MEASURED))
        # compiles; only where there is something to measure
        from dubins_traffic.scoring.margins_kernel import (
            EgoFrame,
            EgoMargins,
            MarginTables,
            find_margins,
            margin_rules,
        )

        problem = self._problem
        rules = RuleParameters.from_mapping(problem.rules)
        found = table(EgoMargins, 1)
        only = np.zeros(1, dtype=np.int64)
        tables = MarginTables(
            rules=margin_rules([rules], [problem.period], only),
            roads=pack([problem.network], [problem.car.lane_width]),
            cars=pack_cars([problem.car]),
            signal=np.zeros(count),
        )
        ego = table(EgoFrame, (1, count))
        for name in ("x", "y", "c", "s", "bits", "lane"):
            ego[name] = np.concatenate([getattr(block, name)[:, EGO] for block in self._blocks])
        find_margins(only, np.array([count]), ego, only, tables, found)
        return margins_by_rule(gap, [found[0].road, found[0].line, found[0].back, found[0].turn])


def entries_by_rule(found: EntryMargins, period: float) -> dict[str, float | None]:
    """Return the margins of rule 3 by the rules' names, seconds, seconds and metres; None without an entry that counts.

    Parameters
    ----------
    found
        The margins that the referee has found.
    period
        Seconds of a tick.
    """
    values = (found.stop * period, found.order * period, found.clear)
    return {
        rule: value if math.isfinite(value) else None for rule, value in zip(ENTERED, values, strict=True)
    }


def margins_of(scores: Iterable[Judged]) -> Floats:
    """Return by how much the ego of each trial kept or broke each rule; a search minimises these.

    Parameters
    ----------
    scores
        Scores of trials whose problems carry rules.

    Returns
    -------
    (B, len(MARGINS)) float64
        Metres, or `UNITS`; infinite where nothing could break the rule. Negative exactly if the ego broke the rule;
        of liveness, exactly if a goal was not visited twice after frame 0, or a gap was too long.
    """
    return np.array([_row(score) for score in scores]).reshape(-1, len(MARGINS))


def _row(score: Judged) -> list[float]:
    verdict = score.verdict
    if verdict is None:
        return [math.inf] * len(MARGINS)
    broken = {own.rule for own in verdict.violations if own.car == EGO_NAME}
    row: list[float] = []
    for rule in MARGINS[:-1]:
        value = verdict.robustness.get(rule)
        value = math.inf if value is None else value
        row.append(min(value, -SURE) if rule in broken else max(value, SURE))
    limit, gap = verdict.gap_limit_s, verdict.longest_gap_s
    spare = math.inf if limit is None or gap is None else limit - gap
    missed = not verdict.recurrent or spare < 0.0
    return [*row, min(spare, -SURE) if missed else max(spare, SURE)]


def margins_by_rule(gap: float | None, found: Sequence[float]) -> dict[str, float | None]:
    """Return the margins by the rules' names, from the smallest gap (m) and the margins of `find_margins`, in order."""
    named = zip(MEASURED, found, strict=True)
    return {"1.collision": gap} | {rule: value if math.isfinite(value) else None for rule, value in named}
