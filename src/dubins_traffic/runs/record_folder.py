"""The folder for the records of a run: it holds none, or they are overwritten or appended to."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

from dubins_traffic.errors import InputError, RecordError
from dubins_traffic.files import locked
from dubins_traffic.problem.instance import Instance
from dubins_traffic.protocols import End
from dubins_traffic.record import reader
from dubins_traffic.record.header import bare_name
from dubins_traffic.record.wall import remove_record

OURS: Final = re.compile(r"trial-(\d{4,})(?:-(\d+))?\.mcap")
"""File names of records: the number of the trial, and of its run if there are several."""
BROKEN_OFF: Final = (End.INTERRUPTED, End.TRANSPORT_LOST)
"""Ends that are not due to the driver: such a trial is run again."""
WAYS: Final = "a folder without records; --overwrite removes those that are there, --append goes on with them"


def name(trial: int, run: int | None = None) -> str:
    """Return the name of the record of a trial, or of one of its runs."""
    return f"trial-{trial:04d}.mcap" if run is None else f"trial-{trial:04d}-{run:04d}.mcap"


def check_choice(
    records: str | os.PathLike[str] | None,
    data: str | os.PathLike[str] | None,
    *,
    overwrite: bool,
    append: bool,
) -> None:
    """Raise InputError if overwriting or appending is asked for without a folder for records, or with trial data."""
    if append and data is not None:
        expected = "one of them: trial data are of all trials of a run"
        raise InputError("both at once", file="--append, -f", value=os.fspath(data), expected=expected)
    if records is None and (overwrite or append):
        raise InputError("are of --records", file="--overwrite, --append", expected="a folder for records")


def check_folder(folder: str | os.PathLike[str]) -> Path:
    """Return `folder`, made if missing; InputError if it can't be made or written to."""
    expected = "a folder, or a place for one"
    if not os.fspath(folder):
        raise InputError("no folder", file="--records", value=folder, expected=expected)
    path = Path(folder)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"can't hold records ({error.strerror})", file=str(path), expected=expected) from None
    if not os.access(path, os.W_OK | os.X_OK, effective_ids=os.access in os.supports_effective_ids):
        raise InputError("no permission to write", file=str(path), expected=expected)
    return path


def claim(
    folder: Path,
    controller: str,
    instance_of: Callable[[int], Instance],
    *,
    overwrite: bool = False,
    append: bool = False,
    placed: bool = False,
) -> frozenset[str]:
    """Prepare a folder for the records of a run; return the names of records that are kept and not run again.

    Parameters
    ----------
    folder : Path
        The folder, which exists.
    controller : str
        Name of the run's controller.
    instance_of : callable
        Returns the instance of a trial by its number; raises InputError if there is no such trial.
    overwrite : bool
        Whether to remove existing records, with their sidecars.
    append : bool
        Whether to keep existing records; they must be of the same controller and instances. Trials whose records were
        cut off, interrupted or lost with their transport are run again.
    placed : bool
        Whether cars may have been moved before a trial; then a record of the same instance may have other starts.
    """
    if overwrite and append:
        raise InputError("both at once", file="--overwrite, --append", expected="one of them")
    with locked(folder):
        records = sorted(path for path in folder.glob("*.mcap") if path.is_file())
        if records and not (overwrite or append):
            others = f" and {len(records) - 1} more" if len(records) > 1 else ""
            raise InputError(f"holds {records[0].name}{others}", file=str(folder), expected=WAYS)
        ours = [path for path in records if OURS.fullmatch(path.name)]
        if append:
            return frozenset(path.name for path in ours if _stays(path, controller, instance_of, placed))
        for path in ours:
            remove_record(path)
        return frozenset()


def _stays(path: Path, controller: str, instance_of: Callable[[int], Instance], placed: bool) -> bool:
    """Tell whether a record of this run is complete; InputError if it is of another run."""
    match = OURS.fullmatch(path.name)
    trial = int(match[1]) if match else 0
    try:
        record = reader.read(path)
    except RecordError as error:
        if "cut off" in error.problem:
            return False
        raise
    if record.controller != bare_name(controller):
        problem = "a record of another controller"
        raise InputError(problem, file=str(path), value=record.controller, expected=bare_name(controller))
    expected = "a record of the same configuration, instance and seed, or another folder"
    try:
        wanted = instance_of(trial)
    except InputError:
        raise InputError("a record of no trial of this run", file=str(path), expected=expected) from None
    if record.instance.seed != wanted.seed:
        problem = "a record of another seed"
        raise InputError(problem, file=str(path), value=record.instance.seed, expected=str(wanted.seed))
    wanted = replace(wanted, starts=record.instance.starts) if placed else wanted
    if record.instance != wanted:
        raise InputError("a record of another instance", file=str(path), value=trial, expected=expected)
    return record.ending is not None and record.ending.end not in BROKEN_OFF


@dataclass(frozen=True, slots=True)
class Earlier:
    """How far an earlier session has come, by its records in a folder.

    Parameters
    ----------
    over : frozenset of int
        Numbers of the instances whose trials have ended.
    runs : mapping of int to int
        For the other instances that have records: the number of the run, from 0, that was broken off.
    """

    over: frozenset[int] = frozenset()
    runs: Mapping[int, int] = field(default_factory=dict[int, int])

    @classmethod
    def of(cls, folder: Path, kept: frozenset[str]) -> Earlier:
        """Return what the records in a folder say; those named in `kept` are complete."""
        last: dict[int, tuple[int, bool]] = {}
        for path in folder.glob("*.mcap"):
            if match := OURS.fullmatch(path.name):
                number, run = int(match[1]), int(match[2] or 0)
                last[number] = max(last.get(number, (-1, False)), (run, path.name in kept))
        over = frozenset(number for number, (_, whole) in last.items() if whole)
        return cls(over, {number: run for number, (run, _) in last.items() if number not in over})
