"""What a search leaves: its cases and counts, and a page of them that loads nothing from elsewhere."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from dubins_traffic.falsification.archive import CASES, PAGE
from dubins_traffic.falsification.case import Case
from dubins_traffic.falsification.coverage import Row
from dubins_traffic.viewer.pages import render

if TYPE_CHECKING:
    from dubins_traffic.falsification.case import Case


COUNTS: Final = {
    "trials": "trials",
    "violated": "in which the ego broke what was asked for",
    "discarded": "discarded, since the assumption fell before",
    "faulty": "ended by a fault",
    "unconfirmed": "breaches that did not come again",
}
"""The counts of a search (`counts.Counts`), and what the page calls them."""


def coverage_page(
    settings: Mapping[str, Any],
    counts: Mapping[str, int],
    rows: Sequence[Row],
    cases: Mapping[str, Case],
    found_in: Mapping[str, int],
) -> str:
    """Return the page of a search; equal arguments give equal text.

    Parameters
    ----------
    settings : mapping
        What tells the search from others: `controller`, `targets`, `seed`, `strategy`.
    counts : mapping
        What became of its trials, by the keys of `COUNTS`.
    rows : sequence of Row
        The coverage.
    cases : mapping
        What was found, by the names of the files.
    found_in : mapping
        For some of these the number of the trial in which each was found, from 0.
    """
    lines: dict[str, dict[str, dict[int, Row]]] = {}
    for row in rows:
        manoeuvres = lines.setdefault(row.cell.rule, {})
        manoeuvres.setdefault(row.cell.manoeuvre.name.lower(), {})[row.cell.degree] = row
    made = [("asked for", ", ".join(settings["targets"]))]
    made += [(name, settings[name]) for name in ("controller", "strategy", "seed")]
    return render(
        "falsification/coverage.html",
        title=f"Coverage of a search: {settings['controller']}",
        told=f"{counts['trials']:,} trials, {len(cases)} kinds of failure.",
        cells=len(rows),
        never=[_name(row) for row in rows if row.empty],
        lines=lines,
        roads={degree: _roads(degree) for degree in sorted({row.cell.degree for row in rows})},
        cases=cases,
        folder=CASES,
        found_in=found_in,
        made=[*made, *((words, f"{counts[name]:,}") for name, words in COUNTS.items())],
    )


def _name(row: Row) -> str:
    return f"{row.cell.rule} {row.cell.manoeuvre.name.lower()}, {_roads(row.cell.degree)}"


def _roads(degree: int) -> str:
    return f"{degree} road{'s' if degree != 1 else ''}" if degree else "no crossing known"


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
