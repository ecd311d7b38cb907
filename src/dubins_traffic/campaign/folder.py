"""The folder of a campaign: what is kept in it as it runs, which records, and what is left when it is resumed."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Generator, Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from dubins_traffic.campaign import manifest, rows, table
from dubins_traffic.campaign.campaign import Campaign
from dubins_traffic.campaign.chunks import Chunk
from dubins_traffic.errors import DubinsTrafficError, InputError
from dubins_traffic.files import LOCK, locked, make_folder, replace_file
from dubins_traffic.record.sink import FAULTS
from dubins_traffic.scoring.verdict import Ruling

RECORDS = "records"


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
        if not (self.campaign / RECORDS).is_dir():
            raise DubinsTrafficError(
                f"{self.campaign} is not on this machine; records need a folder that all machines share"
            )

    def _sampled(self, number: int) -> bool:
        return (number + 1) * self.sample // self.total != number * self.sample // self.total


def record_path(campaign: Path, number: int) -> Path:
    """Return where the record of trial `number` stands."""
    return campaign / RECORDS / f"trial-{number:09d}.mcap"


def is_failure(row: Mapping[str, Any]) -> bool:
    """Tell whether a row is of a trial that somebody's fault ended, or that the ego failed."""
    at_fault = (row["collisions_ego_fault"] or 0) + (row["collisions_both_fault"] or 0)
    return row["end"] in FAULTS or row["verdict"] == Ruling.VIOLATED or at_fault > 0


def read_keep(text: str) -> tuple[Keep, int]:
    """Return what ``none``, ``all``, ``failures`` or ``sample:N`` asks for: of which trials, and N."""
    word, colon, number = text.partition(":")
    if word == Keep.SAMPLE and number.isdecimal() and int(number) > 0:
        return Keep.SAMPLE, int(number)
    if not colon and word in (Keep.NONE, Keep.ALL, Keep.FAILURES):
        return Keep(word), 0
    expected = "none, all, failures or sample:N"
    raise InputError("not a choice of records", file="--records", value=text, expected=expected)


PARTS = "parts"
_PART = re.compile(r"(\d{9})-(\d{9})\.parquet")


@dataclass(frozen=True, slots=True)
class Folder:
    """The folder of a campaign that this process may write.

    `path` is where it is, `records` which records are kept.
    """

    path: Path
    campaign: Campaign
    records: Records | None

    @property
    def finished(self) -> bool:
        """Whether the table is complete."""
        return (self.path / table.RESULTS).is_file()

    def done(self) -> list[tuple[int, int]]:
        """Return the ranges of trials that have rows, as (first, after the last), in order.

        A part that can't be read is removed: its trials run again.
        """
        if self.finished:
            return [(0, self.campaign.total)]
        spans: list[tuple[int, int]] = []
        for first, end, path in parts(self.path):
            if table.is_part(path, end - first, self.campaign.columns):
                spans.append((first, end))
            else:
                path.unlink()
        return spans

    def keep(self, chunk: Chunk, part: bytes) -> None:
        """Store the part of a chunk that has been run; once this returns, the part survives a loss of power."""
        path = self.path / PARTS / f"{chunk.number:09d}-{chunk.end - 1:09d}.parquet"
        replace_file(path, lambda neighbour: neighbour.write_bytes(part), durable=True)

    def finish(self) -> None:
        """Merge the parts into the table, if that does not exist, and remove them."""
        if not self.finished:
            paths = [path for _, _, path in parts(self.path)]
            for name, kind in ((table.WALL, table.TableKind.WALL), (table.RESULTS, table.TableKind.RESULTS)):
                replace_file(
                    self.path / name,
                    lambda neighbour, kind=kind: table.merge(self.campaign, paths, kind, neighbour),
                    durable=True,
                )
        for _, _, path in parts(self.path):
            path.unlink()


def parts(folder: Path) -> list[tuple[int, int, Path]]:
    """Return the parts in a campaign's folder, as (first trial, after the last, path), in order."""
    place = folder / PARTS
    entries = sorted(place.iterdir()) if place.is_dir() else []
    matches = ((_PART.fullmatch(path.name), path) for path in entries)
    return [(int(match[1]), int(match[2]) + 1, path) for match, path in matches if match]


def kept(folder: Path) -> int:
    """Return how many trials of an unfinished campaign have their rows in its folder."""
    return sum(end - first for first, end, _ in parts(folder))


def remaining(chunks: Iterable[Chunk], done: list[tuple[int, int]]) -> Iterator[Chunk]:
    """Yield `chunks` (in order) without the trials in the ranges `done` (in order, not overlapping)."""
    k = 0
    for chunk in chunks:
        start = chunk.number
        while k < len(done) and done[k][0] < chunk.end:
            first, end = done[k]
            if start < first:
                yield chunk.part(start, first)
            start = max(start, end)
            if end > chunk.end:
                break
            k += 1
        if start < chunk.end:
            yield chunk.part(start, chunk.end)


@contextlib.contextmanager
def opened(path: Path, campaign: Campaign, *, resume: bool, records: str | None) -> Generator[Folder]:
    """Open the folder of a campaign for this process alone, and make it if there is none.

    Parameters
    ----------
    path : Path
        The folder.
    campaign : Campaign
        The campaign to run there.
    resume : bool
        Whether to go on with what has been begun there; otherwise the folder must be new or empty.
    records : str or None
        Which records are kept; None: none, or as before.

    Raises
    ------
    InputError
        If the folder holds something else, another campaign or a changed one, is in use or can't be written; if there
        is nothing to go on with.
    MissingExtraError
        Without the extra `campaign`; nothing is made then.
    """
    rows.arrow()
    read_keep(records or Keep.NONE)
    make_folder(path, "a campaign", begun=resume)
    with locked(path):
        known = manifest.read(path)
        if known is None:
            _check_empty(path)
            known = manifest.make(campaign, records or Keep.NONE)
            manifest.write(path, campaign, known)
        elif not resume:
            raise InputError("holds a campaign", file=str(path), expected="a new folder; --resume goes on with it")
        else:
            known = manifest.check_same(path, campaign, records)
        keep, sample = read_keep(known["records"])
        recorded = None if keep is Keep.NONE else Records(path.resolve(), keep, sample, campaign.total)
        for name in (PARTS, *(() if recorded is None else (RECORDS,))):
            make_folder(path / name, "a campaign")
        for name in (".", PARTS):
            for left in (path / name).glob(".*.tmp"):
                left.unlink()
        yield Folder(path, campaign, recorded)


def _check_empty(folder: Path) -> None:
    """Refuse a folder that holds files other than those of a campaign cut off before it had a manifest."""
    ours = {LOCK, manifest.CAMPAIGN}
    for name in sorted(path.name for path in folder.iterdir()):
        if name not in ours and not name.endswith(".tmp"):
            raise InputError(
                f"holds {name} and is no campaign's folder",
                file=str(folder),
                expected="a new or empty folder",
            )
