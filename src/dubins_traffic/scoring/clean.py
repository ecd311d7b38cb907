"""Which trials are clean, and which were cut, which are neither clean nor not (docs/rules.md#clean)."""

from __future__ import annotations

from collections.abc import Sequence

from dubins_traffic.record.sink import BY_CONTROLLER
from dubins_traffic.scoring.collisions import Collision
from dubins_traffic.scoring.verdict import Ruling, Verdict


def told_cut(count: int) -> str:
    """Return what is said beside a share of clean trials of the `count` trials that were cut."""
    return f", {count} cut" if count else ""


def is_clean(verdict: Verdict | None, collisions: Sequence[Collision], *, whole: bool) -> bool:
    """Tell whether a trial is clean; if it is not judged, whether it ran `whole` and the ego touched nothing.

    Norm: docs/rules.md#clean.
    """
    return whole and not collisions if verdict is None else verdict.clean


def was_cut(verdict: str | None, clean: bool | None, end: str | None) -> bool:
    """Tell whether others or the user ended a judged trial before the ego broke anything, by what tables hold of it.

    It is left out of shares of clean trials. Norm: docs/rules.md#cut.
    """
    return verdict == Ruling.UNFINISHED and not clean and end not in BY_CONTROLLER
