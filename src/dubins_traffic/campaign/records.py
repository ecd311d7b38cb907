"""Which records a campaign keeps, and where."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from dubins_traffic.errors import DubinsTrafficError, InputError
from dubins_traffic.record.sink import FAULTS
from dubins_traffic.scoring.verdict import Ruling

FOLDER = "records"


class Keep(StrEnum):
    """Of which trials records are kept."""

    NONE = "none"
    ALL = "all"
    FAILURES = "failures"
    SAMPLE = "sample"


@dataclass(frozen=True, slots=True)
class Records:
    """The records of a campaign of `total` trials, in ``records`` of its folder.

    Parameters
    ----------
    campaign : Path
        Folder of the campaign; its own machine's, or one that all machines share.
    keep : Keep
        Of which trials; `sample` says of how many, evenly spread.
    """

    campaign: Path
    keep: Keep
    sample: int
    total: int

    def path(self, number: int) -> Path | None:
        """Return where trial `number` is to be recorded; None if it is not."""
        if self.keep is Keep.SAMPLE and not self._sampled(number):
            return None
        return record_path(self.campaign, number)

    def keeps(self, row: Mapping[str, Any]) -> bool:
        """Tell whether the record of a trial that has been run is kept."""
        return self.keep is not Keep.FAILURES or is_failure(row)

    def check(self) -> None:
        """Raise an error if the records' folder is not that of the campaign."""
        if not (self.campaign / FOLDER).is_dir():
            raise DubinsTrafficError(
                f"{self.campaign} is not on this machine; records need a folder that all machines share"
            )

    def _sampled(self, number: int) -> bool:
        return (number + 1) * self.sample // self.total != number * self.sample // self.total


def record_path(campaign: Path, number: int) -> Path:
    """Return where the record of trial `number` stands."""
    return campaign / FOLDER / f"trial-{number:09d}.mcap"


def is_failure(row: Mapping[str, Any]) -> bool:
    """Tell whether a row is of a trial that somebody's fault ended, or that the ego failed."""
    at_fault = (row["collisions_ego_fault"] or 0) + (row["collisions_both_fault"] or 0)
    return row["end"] in FAULTS or row["verdict"] == Ruling.VIOLATED or at_fault > 0


def read_keep(text: str) -> tuple[Keep, int]:
    """Return what ``none``, ``all``, ``failures`` or ``sample:N`` asks for: of which trials, and N.

    Raises
    ------
    InputError
        If `text` is none of these.
    """
    word, colon, number = text.partition(":")
    if word == Keep.SAMPLE and number.isdecimal() and int(number) > 0:
        return Keep.SAMPLE, int(number)
    if not colon and word in (Keep.NONE, Keep.ALL, Keep.FAILURES):
        return Keep(word), 0
    expected = "none, all, failures or sample:N"
    raise InputError("not a choice of records", file="--records", value=text, expected=expected)
