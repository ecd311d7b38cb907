"""The verdicts on formulas after every tick of a running trial, as reward machines need them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from dubins_traffic.cars.state import Frames
from dubins_traffic.problem.formulas import check_formulas
from dubins_traffic.scoring.formulas import FormulaVerdicts, Status

if TYPE_CHECKING:
    from dubins_traffic.engine.group import Group
    from dubins_traffic.problem.instance import Instance


class FormulaWatch:
    """Judges formulas, which are not part of the instance, frame by frame on one trial of a group.

    Parameters
    ----------
    group : Group
        The trials.
    row : int
        Which of them, in its first frame.
    formulas : Mapping
        Texts by name.

    Attributes
    ----------
    states : dict
        What is said of each formula after the frames looked at: ``true``, ``presumably true``, ``presumably false`` or
        ``false``.
    """

    def __init__(self, group: Group, row: int, formulas: Mapping[str, str]) -> None:
        self._group, self._row = group, row
        self._verdicts = FormulaVerdicts()
        self._verdicts.begin(with_formulas(group.instances[row], formulas))
        self._tick, self._contacts = -1, 0
        self.states: dict[str, Status] = {}
        self.look()

    def look(self) -> None:
        """Judge the present frame, unless it has been judged before."""
        group, b = self._group, self._row
        instance, tick = group.instances[b], int(group.ticks[b])
        if tick == self._tick:
            return
        cars, contacts = len(instance.starts), group.contacts[b]
        state, labels = group.of_trial(b)
        asked = [group.commands[b : b + 1, :cars, k] for k in (0, 1)]
        new = tuple(contacts[self._contacts :])
        self._verdicts.frames(Frames(tick, instance.problem.rate, *state[:6], *asked, *labels, contacts=new))
        self._tick, self._contacts = tick, len(contacts)
        self.states = {one.name: one.verdict for one in self._verdicts.result()}


def with_formulas(instance: Instance, formulas: Mapping[str, str]) -> Instance:
    """Return an instance whose problem carries formulas.

    Raises
    ------
    FormulaError
        If one can't be read or monitored, or names what the problem lacks.
    """
    problem = replace(instance.problem, formulas=dict(formulas))
    check_formulas(problem, instance.names)
    return replace(instance, problem=problem)
