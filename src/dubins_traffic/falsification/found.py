"""What a search leaves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from dubins_traffic.falsification.archive import PAGE
from dubins_traffic.falsification.case import Case
from dubins_traffic.falsification.coverage import Row


@dataclass(frozen=True, slots=True)
class Found:
    """What a search leaves.

    Attributes
    ----------
    folder : Path
        Its folder.
    cases : dict of str to Case
        One case for each kind of failure, by the name of its cell.
    trials, discarded, faulty, violated : int
        How many trials it has run; of these, in how many the assumption was broken first, how many ended by a fault,
        and in how many the ego broke a rule that was asked for.
    coverage : list of Row
        Which rule, manoeuvre and crossing were put to the test.
    fault : str
        How many trials ended by which fault, and why the first; empty if none did.
    """

    folder: Path
    cases: Mapping[str, Case]
    trials: int
    discarded: int
    faulty: int
    violated: int
    coverage: list[Row]
    fault: str = ""

    @property
    def page(self) -> Path:
        """The page with the coverage and what was found."""
        return self.folder / PAGE
