"""Writing results of a suite: a page, a table in Markdown, and numbers as CSV."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from dubins_traffic.campaign.report.csv_tables import csv_files
from dubins_traffic.campaign.report.page import page
from dubins_traffic.files import make_folder, require_output, write_text
from dubins_traffic.suites.cases_page import cases_page, cases_table, columns_of
from dubins_traffic.suites.comparing import Source, compare_trials, made_by, shares, where_they_ran
from dubins_traffic.suites.games_page import answers_of, games_page, games_table
from dubins_traffic.suites.markdown import trials_table
from dubins_traffic.suites.suite import Suite

PAGE = "index.html"
TABLE = "results.md"


def results(suite: Suite, sources: Sequence[Source]) -> dict[str, str]:
    """Return the files of results by name: `PAGE`, `TABLE`, and of a suite of trials CSV; same sources, same texts.

    Raises
    ------
    InputError
        As `compare_trials`, `columns_of` and `answers_of`.
    """
    told = [line for line in (where_they_ran(sources), made_by(sources)) if line]
    how = " ".join(told)
    note = "".join(f"\n{line}\n" for line in (*shares(sources), *told))
    if suite.model.cases is not None:
        found = columns_of(suite, sources)
        return {TABLE: cases_table(suite, found) + note, PAGE: cases_page(suite, found, how)}
    if suite.model.games is not None:
        answers = answers_of(suite, sources)
        return {TABLE: games_table(suite, answers) + note, PAGE: games_page(suite, answers, how)}
    comparison, made = compare_trials(suite, sources)
    return {
        **csv_files(comparison),
        TABLE: trials_table(suite, comparison) + note,
        PAGE: page(comparison, made, {}),
    }


def write_results(suite: Suite, sources: Sequence[Source], folder: Path, *, overwrite: bool = False) -> str:
    """Write the files of results into a folder and return the table in Markdown.

    Files that are there are replaced only if `overwrite` is given.

    Raises
    ------
    InputError
        As `results`, if a path is refused (`files.require_output`), or if a file can't be written.
    """
    found = results(suite, sources)
    make_folder(folder, "results")
    for name in found:
        require_output(folder / name, "results", [Path(name).suffix], overwrite=overwrite)
    for name, text in found.items():
        write_text(folder / name, text)
    return found[TABLE]
