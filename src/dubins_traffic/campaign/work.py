"""The work of a campaign, chunk by chunk: what runs in a worker, wherever that is."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dubins_traffic.campaign import rows
from dubins_traffic.campaign.campaign import Chunk
from dubins_traffic.campaign.many import Job
from dubins_traffic.campaign.records import Records, remove_record
from dubins_traffic.controllers import registry as controllers
from dubins_traffic.errors import DubinsTrafficError

if TYPE_CHECKING:
    from multiprocessing.synchronize import Event


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What workers share: which records are kept, and where modules of controllers are looked up."""

    records: Records | None
    paths: tuple[str, ...]

    @staticmethod
    def here(records: Records | None = None) -> Surroundings:
        """Return those of this process."""
        return Surroundings(records, (str(Path.cwd()), *sys.path))


def run_chunk(chunk: Chunk, records: Records | None = None, cancelled: Event | None = None) -> rows.Columns:
    """Run the trials of a chunk and return their rows, whatever becomes of each.

    A trial that can't be drawn, run or scored is a row with its reason. `cancelled` interrupts the chunk.

    Raises
    ------
    InputError
        If there is no such controller here: a fault of this machine, not of a trial.
    KeyboardInterrupt
        If it was interrupted; nothing of the chunk counts then.
    """
    if records is not None:
        records.check()
    controllers.load(chunk.controller)
    return rows.columns([_row(chunk, k, records, cancelled) for k in range(chunk.count)])


def run_part(chunk: Chunk, around: Surroundings, cancelled: Event | None = None) -> bytes:
    """Run a chunk and return its part of the table, a Parquet file."""
    for path in around.paths:
        if path not in sys.path:
            sys.path.append(path)
    return rows.encoded(run_chunk(chunk, around.records, cancelled))


def _row(chunk: Chunk, k: int, records: Records | None, cancelled: Event | None) -> rows.Row:
    number, trial = chunk.number + k, chunk.trial + k
    if cancelled is not None and cancelled.is_set():
        raise KeyboardInterrupt
    record = None if records is None else records.path(number)
    job = Job(
        trial,
        chunk.seed,
        chunk.controller,
        configuration=chunk.configuration,
        record=record,
        overwrite=True,
        deadline=chunk.deadline,
    )
    try:
        found = rows.row(number, job.run(cancelled))
    except DubinsTrafficError as error:
        found = rows.failure(number, rows.FAILED, str(error))
    except Exception as error:  # one bad trial is a row, never the end of the campaign
        found = rows.failure(number, rows.FAILED, f"{type(error).__name__}: {error}")
    if records is not None and record is not None and not records.keeps(found):
        remove_record(record)
    return found
