"""How far the ego stays from breaking the rules that have a measure: collisions, the road, the lane, the way back."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from dubins_traffic.cars.state import EGO, Frames
from dubins_traffic.cars.tables import pack_cars
from dubins_traffic.kernels.records import table
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.sink import Ending
from dubins_traffic.roads.table import pack
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.scoring.clearance import Clearance

MEASURED: Final = ("1.road", "2.left", "2.return")
"""The rules whose margins `find_margins` finds, in the order of `EgoMargins`."""


class Margins:
    """The robustness of the ego's rules 1 and 2 (`logic.robustness`), in metres.

    The signals are the gap to the nearest other body, the distance of the centre to the edge of the road, and how far
    the body reaches beyond the line at which `left` rises (or, once it has risen, falls); `overtaking` and `hemmed` are
    infinite. The robustness of ``[] (left -> overtaking)`` is the least margin to the line while the ego does not
    overtake, that of ``[] (left -> <>[0,d] (!left | hemmed))`` the least of the greatest margins within d.
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
        """Return the robustness of each rule by its name, metres; None where nothing could break it.

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
        return margins_by_rule(gap, [found[0].road, found[0].line, found[0].back])


def margins_by_rule(gap: float | None, found: Sequence[float]) -> dict[str, float | None]:
    """Return the margins by the rules' names, given the smallest gap and what `find_margins` finds, in order."""
    named = zip(MEASURED, found, strict=True)
    return {"1.collision": gap} | {rule: value if math.isfinite(value) else None for rule, value in named}
