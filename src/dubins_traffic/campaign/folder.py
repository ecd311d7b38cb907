"""The folder of a campaign: its lock, the parts of its table, and the table itself."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Generator, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from dubins_traffic.campaign import manifest, rows, table
from dubins_traffic.campaign.campaign import Campaign
from dubins_traffic.campaign.chunks import Chunk
from dubins_traffic.campaign.records import FOLDER as RECORDS
from dubins_traffic.campaign.records import Keep, Records, read_keep
from dubins_traffic.errors import InputError
from dubins_traffic.files import LOCK, locked, make_folder, replace_file

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
        found: list[tuple[int, int]] = []
        for first, end, path in parts(self.path):
            if table.is_part(path, end - first, self.campaign.columns):
                found.append((first, end))
            else:
                path.unlink()
        return found

    def keep(self, chunk: Chunk, part: bytes) -> None:
        """Store the part of a chunk that has been run; once this returns, the part survives a loss of power.

        Raises
        ------
        InputError
            If it can't be written: a full disk, a folder without permission.
        """
        path = self.path / PARTS / f"{chunk.number:09d}-{chunk.end - 1:09d}.parquet"
        replace_file(path, lambda neighbour: neighbour.write_bytes(part), durable=True)

    def finish(self) -> None:
        """Merge the parts into the table, if that does not exist, and remove them.

        Raises
        ------
        InputError
            If it can't be written; the parts remain then.
        """
        if not self.finished:
            found = [path for _, _, path in parts(self.path)]
            for name, kind in ((table.WALL, table.Kind.WALL), (table.RESULTS, table.Kind.RESULTS)):
                replace_file(
                    self.path / name,
                    lambda neighbour, kind=kind: table.merge(self.campaign, found, kind, neighbour),
                    durable=True,
                )
        for _, _, path in parts(self.path):
            path.unlink()


def parts(folder: Path) -> list[tuple[int, int, Path]]:
    """Return the parts in a campaign's folder, as (first trial, after the last, path), in order."""
    place = folder / PARTS
    found = sorted(place.iterdir()) if place.is_dir() else []
    matches = ((_PART.fullmatch(path.name), path) for path in found)
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
            raise InputError(
                "holds a campaign", file=str(path), expected="a new folder; --resume goes on with it"
            )
        else:
            known = manifest.check_same(path, campaign, records)
        keep, sample = read_keep(known["records"])
        own = None if keep is Keep.NONE else Records(path.resolve(), keep, sample, campaign.total)
        for name in (PARTS, *(() if own is None else (RECORDS,))):
            make_folder(path / name, "a campaign")
        for name in (".", PARTS):
            for left in (path / name).glob(".*.tmp"):
                left.unlink()
        yield Folder(path, campaign, own)


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
