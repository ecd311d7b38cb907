"""The table that the benchmarks print."""

from __future__ import annotations

import os
import platform
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Row:
    """A figure, what is asked of it, and whether it is so."""

    name: str
    figure: str
    bar: str
    met: bool


def machine() -> str:
    """Return a sentence about processor and versions."""
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.is_file() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    kind = names[0] if names else platform.machine()
    parts = [f"{name} {version(name)}" for name in ("numpy", "numba")]
    return f"{os.cpu_count()} cores of {kind}, Python {platform.python_version()}, {', '.join(parts)}."


def show(title: str, rows: Sequence[Row]) -> bool:
    """Print rows and return whether every bar is met."""
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    for column in ("what", "measured", "bar", ""):
        table.add_column(column, overflow="fold")
    for row in rows:
        table.add_row(escape(row.name), escape(row.figure), escape(row.bar), _told(row))
    Console(width=120).print(table)
    return all(row.met for row in rows)


def _told(row: Row) -> str:
    """Return whether a bar is met, nothing where there is none."""
    if not row.met:
        return "[b]missed[/b]"
    return "met" if row.bar else ""
