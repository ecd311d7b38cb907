"""Verdicts on the formulas that a problem carries beside its task."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Literal, cast

import numpy as np

from dubins_traffic.cars.state import Frames
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.logic.automaton import FALSE, TRUE, VERDICTS
from dubins_traffic.logic.formula import propositions
from dubins_traffic.logic.monitor import Monitors
from dubins_traffic.logic.parse import parse
from dubins_traffic.logic.robustness import outlook
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.sink import Ending
from dubins_traffic.rules.vocabulary import Vocabulary
from dubins_traffic.scoring.metric import Column, ScoreColumn
from dubins_traffic.scoring.signals import SURE, Signals

if TYPE_CHECKING:
    from dubins_traffic.rules.valuation import Valuation

MOST: Final = 1e6
"""Robustness, as an absolute value, of a formula broken by something that has no measure."""
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
    robustness : float or None
        Distance of the trial from breaking the formula, in the units of `scoring.signals`: negative exactly if the
        verdict is ``false``; None if nothing could break it.
    """

    name: str
    formula: str
    verdict: Status
    time: float | None
    early: bool = True
    robustness: float | None = None

    def to_json(self) -> dict[str, Any]:
        """Return the verdict as a JSON object."""
        return {
            "name": self.name,
            "formula": self.formula,
            "verdict": self.verdict,
            "time": self.time,
            "early": self.early,
            "robustness": self.robustness,
        }


class FormulaVerdicts:
    """A sink that judges the formulas of a problem."""

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

        self._formulas = {name: parse(text) for name, text in self._texts.items()}
        used = dict.fromkeys(word for formula in self._formulas.values() for word in propositions(formula))
        self._valuation = Valuation(instance, list(used))
        vocabulary = Vocabulary(problem, instance.names)
        self._signals = Signals(instance, {word: vocabulary[word] for word in used})
        self._monitors = Monitors(self._formulas, list(used), problem.period)
        self._monitors.reset(1)
        self._since = np.full(len(self._formulas), -1, dtype=np.int64)

    def frames(self, frames: Frames) -> None:
        """Judge a block of frames."""
        if self._valuation is None:
            return
        held = self._valuation.values(frames)
        self._signals.take(frames, held)
        for row, values in enumerate(held):
            verdicts = self._monitors.update(values[None, :])[0]
            decided = (verdicts == FALSE) | (verdicts == TRUE)
            self._since[decided & (self._since < 0)] = frames.first + row

    def end(self, ending: Ending) -> None:
        """Nothing is left to do."""

    def result(self) -> tuple[FormulaVerdict, ...]:
        """Return the verdicts up to the last frame, in the order of the problem."""
        if self._valuation is None:
            return ()
        signals = self._signals.result()
        verdicts = zip(self._texts.items(), self._monitors.verdicts[0].tolist(), self._since.tolist(), strict=True)
        return tuple(
            FormulaVerdict(
                name,
                text,
                cast("Status", VERDICTS[verdict]),
                None if tick < 0 else tick / self._rate,
                name not in self._monitors.late,
                self._margin(name, signals, broken=verdict == FALSE),
            )
            for (name, text), verdict, tick in verdicts
        )

    def _margin(self, name: str, signals: Mapping[str, Floats], *, broken: bool) -> float | None:
        """Return the robustness of a formula for any continuation of the trial, with the sign of its verdict."""
        _, most = outlook(self._formulas[name], signals, 1.0 / self._rate)
        value = float(most[0]) if most.size else math.inf
        if broken:
            return max(-MOST, min(value, -SURE))
        return max(value, SURE) if math.isfinite(value) else None


def _in_short(formulas: Sequence[FormulaVerdict]) -> str | None:
    """Return the verdicts on the user's formulas as JSON, None without formulas."""
    by_name = {one.name: one.verdict for one in formulas}
    return json.dumps(by_name) if by_name else None


COLUMNS = (ScoreColumn(Column("formulas", kind="string"), lambda score: _in_short(score.formulas)),)
