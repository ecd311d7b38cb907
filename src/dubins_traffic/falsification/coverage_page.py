"""What a search has put to the test and found, as a page that loads nothing from elsewhere."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from dubins_traffic.falsification.archive import CASES
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
