"""What a search has put to the test and found, as a page that loads nothing from elsewhere."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final
from urllib.parse import quote

from dubins_traffic.campaign.report.markup import base_style, document, section, table, text
from dubins_traffic.falsification.archive import CASES
from dubins_traffic.falsification.coverage import Row

if TYPE_CHECKING:
    from dubins_traffic.falsification.case import Case

STYLE: Final = """
.never { display: block; padding: 0 .5rem; border-left: 4px solid var(--warning); background: var(--alarm) }
"""
"""Beside the style sheet of all reports."""
NEVER: Final = '<b class="never">\N{WARNING SIGN} never tested</b>'
NO_SUCH: Final = '<span class="note">none expected</span>'
WHAT: Final = (
    "A rule is put to the test by what could have broken it. A cell that never was is a warning: nothing is known "
    "there, however long the search."
)
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
    title = f"Coverage of a search: {settings['controller']}"
    sections = [
        section("What was put to the test", f"<p>{text(WHAT)}</p>\n{_table(rows)}" if rows else _NONE),
        section("What was found", _found(cases, found_in)),
        section("How it was searched", _made(settings, counts)),
    ]
    return document(title, f"{base_style()}\n{STYLE.strip()}", _head(title, counts, rows, cases), sections)


_NONE: Final = "<p>What was asked for has no cells: the rules were not.</p>"


def _head(title: str, counts: Mapping[str, int], rows: Sequence[Row], cases: Mapping[str, Case]) -> str:
    never = [row for row in rows if row.empty]
    told = f"{counts['trials']:,} trials, {len(cases)} kinds of failure."
    warning = (
        f'<p class="warning">\N{WARNING SIGN} {len(never)} of {len(rows)} cells were never put to the test: '
        f"{text('; '.join(map(_name, never)))}.</p>"
    )
    return f"<header><h1>{text(title)}</h1><p>{text(told)}</p>{warning if never else ''}</header>"


def _name(row: Row) -> str:
    return f"{row.cell.rule} {row.cell.manoeuvre.name.lower()}, {_roads(row.cell.degree)}"


def _roads(degree: int) -> str:
    return f"{degree} road{'s' if degree != 1 else ''}" if degree else "no crossing known"


def _table(rows: Sequence[Row]) -> str:
    """Return a line for each rule and manoeuvre, with a column for each number of roads that meet."""
    degrees = sorted({row.cell.degree for row in rows})
    lines: dict[str, dict[str, dict[int, Row]]] = {}
    for row in rows:
        manoeuvres = lines.setdefault(row.cell.rule, {})
        manoeuvres.setdefault(row.cell.manoeuvre.name.lower(), {})[row.cell.degree] = row
    body: list[list[str]] = []
    for rule, manoeuvres in lines.items():
        for k, (manoeuvre, own) in enumerate(manoeuvres.items()):
            first = "" if k else f'<th rowspan="{len(manoeuvres)}">{text(rule)}</th>'
            cells = [_cell(own.get(degree)) for degree in degrees]
            body.append([first, f'<th class="name">{text(manoeuvre)}</th>', *cells])
    return table(["rule", "manoeuvre", *map(_roads, degrees)], body, "grouped")


def _cell(row: Row | None) -> str:
    if row is None:
        return NO_SUCH
    if row.empty:
        return NEVER
    return f"tested {row.tested:,}" + (f", <b>broken {row.broken:,}</b>" if row.broken else "")


def _found(cases: Mapping[str, Case], found_in: Mapping[str, int]) -> str:
    if not cases:
        return "<p>Nothing. A search that finds nothing says nothing about what it did not try.</p>"
    body = [
        [
            f'<th><a href="{CASES}/{quote(name)}.json">{text(name)}</a></th>',
            text(case.story.sentence),
            f"{found_in[name]:,}" if name in found_in else "",
        ]
        for name, case in sorted(cases.items())
    ]
    return table(["case", "what happens", "found in trial"], body, "texts")


def _made(settings: Mapping[str, Any], counts: Mapping[str, int]) -> str:
    asked = [(name, settings[name]) for name in ("controller", "strategy", "seed")]
    told = [("asked for", ", ".join(settings["targets"])), *asked]
    told += [(words, f"{counts[name]:,}") for name, words in COUNTS.items()]
    body = [[f"<th>{text(name)}</th>", text(str(value))] for name, value in told]
    return table(["what", "value"], body, "texts")
