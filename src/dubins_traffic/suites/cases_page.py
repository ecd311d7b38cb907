"""What several controllers did in the cases of a suite: a table in Markdown and a page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from dubins_traffic.campaign.report.markup import base_style, document, section, table, text
from dubins_traffic.campaign.report.statistics import share
from dubins_traffic.errors import InputError
from dubins_traffic.record.sink import BY_CONTROLLER, FAULTS
from dubins_traffic.scoring.verdict import told_cut, was_cut
from dubins_traffic.suites.comparing import Source, check_suite, named_entries
from dubins_traffic.suites.markdown import markdown_table
from dubins_traffic.suites.suite import Suite

Columns = Mapping[str, Sequence[Any]]


def columns_of(suite: Suite, sources: Sequence[Source]) -> dict[str, Columns]:
    """Return the columns of each entry in files of results, one value a case.

    Raises
    ------
    InputError
        If the suite is another one here, a name stands twice, or a file has not the cases of the suite.
    """
    check_suite(suite, sources)
    count = len(suite.model.cases or ())
    found: dict[str, Columns] = {}
    for one in named_entries(sources):
        columns = one.entry.columns
        for name in ("end", "verdict", "clean", "breaches"):
            if len(columns.get(name, ())) != count:
                raise InputError(
                    "a column is missing, or of another length",
                    file=str(one.source.path),
                    field=f"{one.entry.controller}.columns.{name}",
                    expected=f"{count} values",
                )
        found[one.name] = columns
    return found


def cases_table(suite: Suite, found: Mapping[str, Columns]) -> str:
    """Return a heading, the cases with the verdict on each controller, and the share of clean ones."""
    told = f"# {suite.name}\n\n{suite.model.title}. Hash `{suite.hash}`."
    return f"{told}\n\n{markdown_table(['case', *found], _body(suite, found))}"


def cases_page(suite: Suite, found: Mapping[str, Columns], how: str) -> str:
    """Return the same as a page in HTML, with a sentence on how it was made."""
    body = [[f"<th>{text(name)}</th>", *map(text, cells)] for name, *cells in _body(suite, found)]
    head = f"<header><h1>{text(suite.label)}</h1><p>{text(suite.model.title)}</p></header>"
    made = table(["what", "value"], [["<th>hash</th>", f"<code>{suite.hash}</code>"]], "texts")
    made += f"<p>{text(how)}</p>"
    sections = [section("Cases", table(["case", *found], body)), section("How it was made", made)]
    return document(suite.label, base_style(), head, sections)


def _body(suite: Suite, found: Mapping[str, Columns]) -> list[list[str]]:
    cases = suite.model.cases or ()
    rows = [[case.name, *(_said(own, k) for own in found.values())] for k, case in enumerate(cases)]
    ended = ["ended by the controller", *(str(_ended(own)) for own in found.values())]
    return [*rows, ["clean", *(_clean(own) for own in found.values())], ended]


def _said(columns: Columns, case: int) -> str:
    """Return the verdict on a case, or how it ended if by a fault, and how many rules the ego broke."""
    verdict, end, broken = (columns[name][case] for name in ("verdict", "end", "breaches"))
    if verdict is None or end in FAULTS:
        verdict = str(end).replace("_", " ")
    return f"{verdict}, {broken} breach{'es' if broken != 1 else ''}" if broken else str(verdict)


def _ended(columns: Columns) -> int:
    return sum(end in BY_CONTROLLER for end in columns["end"])


def _clean(columns: Columns) -> str:
    cut = sum(map(was_cut, columns["verdict"], columns["clean"], columns["end"]))
    own = share(sum(bool(value) for value in columns["clean"]), len(columns["clean"]) - cut)
    low, high = own.interval or (0.0, 1.0)
    return f"{own.count} of {own.total} [{low:.1%}, {high:.1%}]{told_cut(cut)}"
