"""The scores that examples of pages show: each table has a number above 0 that a reader can change by his own work."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

ROW = re.compile(r"^ *\d+ .*?\b(?:no|yes|cut) +(\d+)(?: of \d+)? +([\d.]+) +(\d+)? ?")
SUM = re.compile(r"^ *sum +(\d+) +([\d.]+)")


class Shown(NamedTuple):
    """A table of scores: counted rounds in all, mean rounds before the first breach, breaches in all."""

    counted: int
    before: float
    breaches: int


def tables(out: str) -> list[Shown]:
    """Return the tables of scores that a command has printed."""
    found: list[Shown] = []
    breaches = 0
    for line in out.splitlines():
        if row := ROW.match(line):
            breaches += int(row[3] or 0)
        if total := SUM.match(line):
            found.append(Shown(int(total[1]), float(total[2]), breaches))
            breaches = 0
    return found


def require_progress(found: Sequence[Shown]) -> None:
    """See that each table has a number above 0, and some table of the page a lawful round, or a part of one."""
    if not found:
        return
    assert all(any(own) for own in found), found
    assert any(own.counted or own.before for own in found), found
