"""Cells of an archive and of a coverage table: which rule, in which manoeuvre, at a crossing of which degree."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Final

from dubins_traffic.scoring.verdict import EGO_RULES

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
