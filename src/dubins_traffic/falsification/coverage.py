"""Which rule, manoeuvre and crossing a search has put to the test: a table in which an empty cell is a warning."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dubins_traffic.falsification.cells import Cell, Manoeuvre
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.scoring.verdict import EGO_RULES

if TYPE_CHECKING:
    from dubins_traffic.kernels.arrays import Ints
    from dubins_traffic.problem.instance import Instance

THROUGH: Final = (Manoeuvre.STRAIGHT, Manoeuvre.LEFT, Manoeuvre.RIGHT)
ALONG: Final = {
    "1.collision": (Manoeuvre.DRIVING, Manoeuvre.OVERTAKING),
    "1.road": (Manoeuvre.DRIVING, Manoeuvre.OVERTAKING),
    "2.left": (Manoeuvre.OVERTAKING,),
    "2.return": (Manoeuvre.OVERTAKING,),
    "2.turn": (Manoeuvre.DRIVING, Manoeuvre.OVERTAKING),
}
"""What an ego does on a road when it may break a rule; of other rules nothing is expected."""


def possible(instances: Iterable[Instance]) -> list[Cell]:
    """Return the cells that can be put to the test on the roads of some instances.

    Turning round and whatever is cut off by the beginning or the end of a trial is left out.
    """
    found: set[Cell] = set()
    for instance in instances:
        least = RuleParameters.from_mapping(instance.problem.rules).crossing_degree
        for degree in {int(degree) for degree in instance.problem.network.degrees}:
            through = THROUGH if degree > 2 else ()
            for rule in EGO_RULES:
                if rule.startswith("3."):
                    found |= {Cell(rule, own, degree) for own in through if degree >= least}
                else:
                    at_discs = through if rule.startswith("1.") else ()
                    found |= {Cell(rule, own, degree) for own in (*ALONG.get(rule, ()), *at_discs)}
    return sorted(found, key=lambda cell: cell.number)


@dataclass(frozen=True, slots=True)
class Row:
    """A cell of a coverage table: how often it was put to the test, and in how many trials it was broken.

    What broke a rule has put it to the test, whatever brought it about.
    """

    cell: Cell
    tested: int
    broken: int

    @property
    def empty(self) -> bool:
        """Whether nothing is known of the cell."""
        return not self.tested and not self.broken

    def to_json(self) -> dict[str, Any]:
        """Return the row as a JSON object."""
        return {
            "rule": self.cell.rule,
            "manoeuvre": self.cell.manoeuvre.name.lower(),
            "degree": self.cell.degree,
            "tested": self.tested,
            "broken": self.broken,
        }


def coverage(expected: Iterable[Cell], exercised: Ints, broken: Ints) -> list[Row]:
    """Return a row for each cell that is expected, tested or broken, in order.

    Parameters
    ----------
    expected : iterable of Cell
        The cells that can be put to the test.
    exercised, broken : (CELLS,)
        How often each cell was put to the test, and in how many trials it was broken.
    """
    numbers = {cell.number for cell in expected}
    numbers |= {number for number in range(len(exercised)) if exercised[number] or broken[number]}
    tested = np.maximum(exercised, broken)
    return [Row(Cell.of(number), int(tested[number]), int(broken[number])) for number in sorted(numbers)]
