"""All speeds in one table, in one run: ours, a bare kernel, and other simulators.

    python -m benchmarks.overview

prints the table and puts it into `benchmarks/README.md`; `python -m benchmarks overview` only prints it.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from benchmarks import campaign, envs, generation, monitors, peers, queries
from benchmarks.table import Row, machine, show
from dubins_traffic.files import write_text

README = Path(__file__).parent / "README.md"
BEGIN, END = "<!-- begin of the table -->\n", "<!-- end of the table -->\n"


def measure() -> list[Row]:
    """Return the rows of this benchmark."""
    return [
        *peers.measure(),
        *envs.measure(),
        *monitors.measure(),
        *queries.measure(),
        *generation.measure(),
        *campaign.overhead(),
    ]


def markdown(rows: Sequence[Row]) -> str:
    """Return the table of some rows, below the machine that they were measured on."""
    lines = [f"| {row.name} | {row.figure}{_bar(row)} |" for row in rows]
    return "\n".join([machine(), "", "| what | measured |", "|---|---|", *lines, ""])


def _bar(row: Row) -> str:
    return f" (bar: {row.bar}, {'met' if row.met else 'missed'})" if row.bar else ""


def put(text: str, table: str) -> str:
    """Return a text with another table between its two marks."""
    before, rest = text.split(BEGIN, 1)
    _, after = rest.split(END, 1)
    return f"{before}{BEGIN}{table}{END}{after}"


def main() -> None:
    """Measure, print, and put the table into the README."""
    rows = measure()
    show("overview", rows)
    write_text(README, put(README.read_text(encoding="utf-8"), markdown(rows)))


if __name__ == "__main__":
    main()
