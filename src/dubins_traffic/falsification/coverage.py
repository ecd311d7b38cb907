"""Which rule, in which manoeuvre, at which crossing: the cells of an archive, and how often each was tried."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import IntEnum
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dubins_traffic.campaign.notice import fault_notice
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.scoring.verdict import EGO_RULES

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance


DEGREES: Final = 5
"""At most four roads meet at an intersection; 0 stands for none that is known."""


class Manoeuvre(IntEnum):
    """What the ego does."""

    DRIVING = 0
    """It is on a road."""
    OVERTAKING = 1
    """It is on a road and overtakes, left of the centre line or about to be."""
    TURNED = 2
    """It is on a road on which it has turned round."""
    STRAIGHT = 3
    """It goes straight on through a disc."""
    LEFT = 4
    """It turns left there."""
    RIGHT = 5
    """It turns right there."""
    BACK = 6
    """It leaves the disc by the road by which it came."""
    ENTERING = 7
    """It enters a disc that it does not leave before the end."""
    LEAVING = 8
    """It is in a disc in which it has started."""


MANOEUVRES: Final = len(Manoeuvre)
CELLS: Final = len(EGO_RULES) * MANOEUVRES * DEGREES


@dataclass(frozen=True, slots=True, order=True)
class Cell:
    """One kind of failure: a rule (its name), a manoeuvre, and how many roads meet where it is about."""

    rule: str
    manoeuvre: Manoeuvre
    degree: int

    @property
    def name(self) -> str:
        """The cell as a name of a file: ``3.clear-left-4``."""
        rule = self.rule.replace(" ", "-")
        return f"{rule}-{self.manoeuvre.name.lower()}-{self.degree}"

    @property
    def number(self) -> int:
        """The number of the cell, 0 to `CELLS` - 1; -1 of a cell of a user's own formula."""
        if self.rule not in EGO_RULES:
            return -1
        return (EGO_RULES.index(self.rule) * MANOEUVRES + self.manoeuvre) * DEGREES + self.degree

    @staticmethod
    def of(number: int) -> Cell:
        """Return the cell of a number."""
        rest, degree = divmod(number, DEGREES)
        rule, manoeuvre = divmod(rest, MANOEUVRES)
        return Cell(EGO_RULES[rule], Manoeuvre(manoeuvre), degree)


@dataclass(slots=True)
class Counts:
    """What became of the trials of a search: how many ran, and of these broke the assumption, failed, broke a rule.

    `faults` counts those that failed by their ends; `first_fault` says which was the first of them, and why.
    """

    trials: int = 0
    discarded: int = 0
    faulty: int = 0
    violated: int = 0
    unconfirmed: int = 0
    """Breaches that did not stand when they were judged afresh."""
    faults: dict[str, int] = field(default_factory=dict[str, int])
    first_fault: str = ""
    exercised: Ints = field(default_factory=lambda: np.zeros(CELLS, dtype=np.int64))
    broken: Ints = field(default_factory=lambda: np.zeros(CELLS, dtype=np.int64))

    def to_json(self) -> dict[str, Any]:
        """Return the counts as a JSON object."""
        names = ("trials", "discarded", "faulty", "violated", "unconfirmed", "faults", "first_fault")
        return {name: getattr(self, name) for name in names}

    def take_fault(self, number: int, fault: str) -> None:
        """Count trial `number` as one that ended by a fault, ``END: REASON``; nothing if it is empty."""
        if fault:
            end = fault.partition(":")[0]
            self.faulty += 1
            self.faults[end] = self.faults.get(end, 0) + 1
            self.first_fault = self.first_fault or f"trial {number}: {fault}"

    def fault_notice(self) -> str:
        """Return the notice that trials ended by a fault; empty if none did."""
        return fault_notice(self.faults, self.trials, self.first_fault)


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
    cells: set[Cell] = set()
    for instance in instances:
        least = RuleParameters.from_mapping(instance.problem.rules).crossing_degree
        for degree in {int(degree) for degree in instance.problem.network.degrees}:
            through = THROUGH if degree > 2 else ()
            for rule in EGO_RULES:
                if rule.startswith("3."):
                    cells |= {Cell(rule, manoeuvre, degree) for manoeuvre in through if degree >= least}
                else:
                    at_discs = through if rule.startswith("1.") else ()
                    cells |= {Cell(rule, manoeuvre, degree) for manoeuvre in (*ALONG.get(rule, ()), *at_discs)}
    return sorted(cells, key=lambda cell: cell.number)


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
