"""The table that the benchmarks print."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Row:
    """A figure, what is asked of it, and whether it is so."""

    name: str
    figure: str
    bar: str
    met: bool


def show(title: str, rows: Sequence[Row]) -> bool:
    """Print rows and return whether every bar is met."""
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    for column in ("what", "measured", "bar", ""):
        table.add_column(column, overflow="fold")
    for row in rows:
        table.add_row(
            escape(row.name), escape(row.figure), escape(row.bar), "met" if row.met else "[b]missed[/b]"
        )
    Console(width=120).print(table)
    return all(row.met for row in rows)
