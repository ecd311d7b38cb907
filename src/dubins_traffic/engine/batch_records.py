"""Which trials of a batch have their records kept, and in which folder."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from dubins_traffic.errors import InputError
from dubins_traffic.protocols import End
from dubins_traffic.runs.record_folder import check_folder
from dubins_traffic.scoring.verdict import Ruling

if TYPE_CHECKING:
    from dubins_traffic.engine.group import Outcome

KEEP = "none, all, failures or sample:K"


def chosen(keep: str, count: int) -> Callable[[int, Outcome], bool]:
    """Return a function that tells, from a trial's place among `count` and its outcome, whether its record is kept.

    Raises
    ------
    InputError
        If `keep` is none of `KEEP`.
    """
    kind, colon, number = keep.partition(":")
    if kind == "sample" and colon and number.isdigit() and int(number) > 0:
        wanted = min(int(number), count)
        sample = {k * count // wanted for k in range(wanted)}
        return lambda place, _outcome: place in sample
    if keep not in ("none", "all", "failures"):
        raise InputError("unknown choice of trials to record", file="--keep", value=keep, expected=KEEP)
    if keep == "failures":
        return lambda _place, outcome: failed(outcome)
    return lambda _place, _outcome: keep == "all"


def failed(outcome: Outcome) -> bool:
    """Tell whether a trial has failed: a rule broken and not excused, a fault, or, if it is not judged, a collision."""
    if outcome.ending.end not in (End.DURATION, End.COLLISION):
        return True
    verdict = outcome.score.verdict
    return bool(outcome.score.collisions) if verdict is None else verdict.verdict is Ruling.VIOLATED


def folder_of(keep: str, records: str | os.PathLike[str] | None) -> Path | None:
    """Return the folder for records, made if missing, or None if none are kept.

    InputError if `keep` asks for records without a folder, a folder is given without `keep`, or it can't be made.
    """
    if keep == "none" or records is None:
        if (keep == "none") != (records is None):
            raise InputError(
                "records are kept in a folder",
                file="--keep, --records",
                value=(keep, records),
                expected="both, or neither",
            )
        return None
    return check_folder(records)
