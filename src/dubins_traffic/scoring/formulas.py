"""Verdicts on the formulas that a problem carries beside its task."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np

from dubins_traffic.cars.state import Frames
from dubins_traffic.logic.automaton import FALSE, TRUE, VERDICTS
from dubins_traffic.logic.formula import propositions
from dubins_traffic.logic.monitor import Monitors
from dubins_traffic.logic.parse import parse
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.sink import Ending
from dubins_traffic.scoring.metric import Column, ScoreColumn

if TYPE_CHECKING:
    from dubins_traffic.rules.valuation import Valuation

Status = Literal["true", "presumably true", "presumably false", "false"]


@dataclass(frozen=True, slots=True)
class FormulaVerdict:
    """The verdict on one formula after the last frame.

    Attributes
    ----------
    name, formula : str
        As the problem has them.
    verdict : str
        ``true``, ``presumably true``, ``presumably false`` or ``false``.
    time : float or None
        Seconds: since which frame the verdict has been true or false for good; None while it is presumed.
    early : bool
        Whether that is said as early as can be; else false may be said later (`logic.monitor`).
    """

    name: str
    formula: str
    verdict: Status
    time: float | None
    early: bool = True

    def to_json(self) -> dict[str, Any]:
        """Return the verdict as a JSON object."""
        return {
            "name": self.name,
            "formula": self.formula,
            "verdict": self.verdict,
            "time": self.time,
            "early": self.early,
        }


class FormulaVerdicts:
    """A sink that judges the formulas of a problem; it costs nothing where there are none."""

    def begin(self, instance: Instance) -> None:
        """Start before the first frame.

        Raises
        ------
        FormulaError
            If a formula can't be read or monitored, or the problem lacks one of its propositions.
        """
        problem = instance.problem
        self._texts = dict(problem.formulas)
        self._rate = problem.rate
        self._valuation: Valuation | None = None
        if not self._texts:
            return
        from dubins_traffic.rules.valuation import (
            Valuation,
        )  # compiles; only where there is something to judge

        formulas = {name: parse(text) for name, text in self._texts.items()}
        used = dict.fromkeys(word for formula in formulas.values() for word in propositions(formula))
        self._valuation = Valuation(instance, list(used))
        self._monitors = Monitors(formulas, list(used), problem.period)
        self._monitors.reset(1)
        self._since = np.full(len(formulas), -1, dtype=np.int64)

    def frames(self, frames: Frames) -> None:
        """Judge a block of frames."""
        if self._valuation is None:
            return
        for row, values in enumerate(self._valuation.values(frames)):
            verdicts = self._monitors.update(values[None, :])[0]
            decided = (verdicts == FALSE) | (verdicts == TRUE)
            self._since[decided & (self._since < 0)] = frames.first + row

    def end(self, ending: Ending) -> None:
        """Nothing is left to do."""

    def result(self) -> tuple[FormulaVerdict, ...]:
        """Return the verdicts up to the last frame, in the order of the problem."""
        if self._valuation is None:
            return ()
        found = zip(
            self._texts.items(), self._monitors.verdicts[0].tolist(), self._since.tolist(), strict=True
        )
        return tuple(
            FormulaVerdict(
                name,
                text,
                cast("Status", VERDICTS[verdict]),
                None if tick < 0 else tick / self._rate,
                name not in self._monitors.late,
            )
            for (name, text), verdict, tick in found
        )


def _in_short(formulas: Sequence[FormulaVerdict]) -> str | None:
    """Return what holds of each formula of a user's own, JSON."""
    found = {one.name: one.verdict for one in formulas}
    return json.dumps(found) if found else None


COLUMNS = (ScoreColumn(Column("formulas", kind="string"), lambda score: _in_short(score.formulas)),)
