"""Runs a campaign in its folder, from the beginning or from where it was cut off, and its chunks in workers."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from dubins_traffic.campaign import folder as folders
from dubins_traffic.campaign import rows
from dubins_traffic.campaign.campaign import Campaign, load_campaign
from dubins_traffic.campaign.chunks import Chunk, Pace
from dubins_traffic.campaign.folder import Folder, Keep, Records
from dubins_traffic.campaign.ray_crew import check_address, crew_at
from dubins_traffic.engine.batch import run_together
from dubins_traffic.engine.egos import Egos
from dubins_traffic.errors import DubinsTrafficError, InputError
from dubins_traffic.outside import put_back
from dubins_traffic.problem.draw import draw_many
from dubins_traffic.record.wall import remove_record
from dubins_traffic.runs.crew import Cancelled, Crew, carry_out, never
from dubins_traffic.scoring import registry as scores
from dubins_traffic.scoring.metric import Maker

if TYPE_CHECKING:
    from dubins_traffic.problem.configuration import Configuration


TOGETHER = 64
"""Most trials that run together."""
CRASH = "the process that ran it ended, each time it was run"


@dataclass(frozen=True, slots=True)
class Part:
    """The errand to run a chunk, and to make of it the bytes of its part of the table; `records` says what is kept."""

    chunk: Chunk
    records: Records | None = None

    @property
    def number(self) -> int:
        """The number of its first trial."""
        return self.chunk.number

    @property
    def trials(self) -> Iterator[Part]:
        """Its trials, one by one."""
        for number in range(self.chunk.number, self.chunk.end):
            yield Part(self.chunk.part(number, number + 1), self.records)

    def run(self, cancelled: Cancelled) -> bytes:
        """Run the chunk."""
        with put_back():
            part = run_chunk(self.chunk, self.records, cancelled)
        return rows.encoded(part, scores.columns(self.chunk.metrics))

    def crashed(self) -> bytes:
        """Return the part of a table in which its trials ended their process each time they were run."""
        metrics = scores.columns(self.chunk.metrics)
        lost = [rows.failure(trial.number, rows.CRASHED, CRASH, metrics) for trial in self.trials]
        return rows.encoded(rows.columns(lost, metrics), metrics)


def run_chunk(chunk: Chunk, records: Records | None = None, cancelled: Cancelled = never) -> rows.Columns:
    """Run the trials of a chunk and return a row for each, whether it succeeds or fails.

    A trial that can't be drawn, run or scored is a row with its reason. `cancelled` interrupts the chunk.

    Raises
    ------
    InputError
        If there is no such controller or metric here: a fault of this machine, not of a trial.
    KeyboardInterrupt
        If it was interrupted; nothing of the chunk counts then.
    """
    if records is not None:
        records.check()
    egos = Egos(chunk.controller)
    _ = egos.shared  # that there is no such controller is told here
    makers = scores.makers(chunk.metrics)
    chunk = replace(chunk, configuration=_known(chunk.configuration))
    by_number: dict[int, rows.Row] = {}
    together = [k for k in range(chunk.count) if not _is_alone(chunk, k, records)]
    for first in range(0, len(together), TOGETHER):
        by_number |= _together(chunk, egos, together[first : first + TOGETHER], cancelled, makers)
    for k in range(chunk.count):
        if k not in by_number or (records is not None and _is_recorded(records, chunk.number + k, by_number[k])):
            by_number[k] = _row(chunk, k, records, cancelled)
    return rows.columns([by_number[k] for k in range(chunk.count)], scores.columns(makers))


def _is_alone(chunk: Chunk, k: int, records: Records | None) -> bool:
    """Tell whether a trial has to run by itself.

    It does under a deadline, and if its record is kept whatever its result; also if it is run alone because it is
    suspected of ending its process.
    """
    if chunk.deadline is not None:
        return True
    if records is None or (records.keep is Keep.FAILURES and chunk.count > 1):
        return False
    return records.path(chunk.number + k) is not None


def _is_recorded(records: Records, number: int, row: rows.Row) -> bool:
    """Tell whether a trial that has been run without a record is one of which a record is kept."""
    return records.path(number) is not None and records.keeps(row)


def _together(
    chunk: Chunk, egos: Egos, some: Sequence[int], cancelled: Cancelled, metrics: Sequence[Maker]
) -> dict[int, rows.Row]:
    """Run trials of a chunk together; return the rows of those that fit a batch.

    Errors of the others come up when they are run by themselves.
    """
    by_number: dict[int, rows.Row] = {}
    try:
        instances = list(draw_many(chunk.configuration, chunk.seed, [chunk.trial + k for k in some]))
        for outcome in run_together(instances, egos, cancelled, metrics):
            k = outcome.instance.trial - chunk.trial
            by_number[k] = rows.row(chunk.number + k, outcome.ending, outcome.score, outcome.act_s)
    except (Exception, SystemExit):  # the trial at fault is found when each is run by itself
        return {}
    return by_number


def _known(configuration: Configuration) -> Configuration:
    """Return the configuration of an earlier chunk if it is equal, since it holds cached results."""
    if not _last or _last[0] != configuration:
        _last[:] = [configuration]
    return _last[0]


_last: list[Configuration] = []


def _row(chunk: Chunk, k: int, records: Records | None, cancelled: Cancelled) -> rows.Row:
    number = chunk.number + k
    if cancelled():
        raise KeyboardInterrupt
    record = None if records is None else records.path(number)
    try:
        result = chunk.job(k, record).run(cancelled)
        row = rows.row(number, result.ending, result.score, result.wall.act_s)
    except DubinsTrafficError as error:
        row = rows.failure(number, rows.FAILED, str(error), scores.columns(chunk.metrics))
    except (Exception, SystemExit) as error:  # one failed trial becomes a row and never ends the campaign
        told = f"{type(error).__name__}: {error}"
        row = rows.failure(number, rows.FAILED, told, scores.columns(chunk.metrics))
    if records is not None and record is not None and not records.keeps(row):
        remove_record(record)
    return row


Progress = Callable[[int, int], object]
"""Called with (trials done, trials in all) at the beginning and whenever a chunk is done."""


@dataclass(frozen=True, slots=True)
class Ran:
    """The result of `run_campaign`: the campaign, its folder, and the number of trials that had rows before."""

    campaign: Campaign
    folder: Path
    before: int


def run_campaign(
    file: str | os.PathLike[str] | Campaign,
    folder: str | os.PathLike[str],
    *,
    workers: int | None = None,
    ray: str | None = None,
    resume: bool = False,
    records: str | None = None,
    progress: Progress | None = None,
) -> Ran:
    """Run a campaign, or what is left of it, and write its table.

    Parameters
    ----------
    file : path or Campaign
        A campaign file, TOML.
    folder : path
        Where everything is kept (`docs/campaigns.md`); made if missing.
    workers : int, optional
        Processes on this machine; by default one for each core. With ``ray="local"``, the size of its cluster.
    ray : str, optional
        Run on a Ray cluster instead: its address, or ``local`` for one on this machine that lives as long as this.
    resume : bool
        Go on with what has been begun in `folder`.
    records : str, optional
        Which records are kept: ``none``, ``all``, ``failures`` or ``sample:N``; by default none, or as before.
    progress : callable, optional
        Called with the numbers of trials done and of all trials.

    Raises
    ------
    InputError
        If something of this is wrong, the campaign is another than that begun in `folder`, or a file can't be written;
        what is finished is kept.
    ClusterLostError
        If the Ray cluster is lost; what is finished is kept.
    KeyboardInterrupt
        On Ctrl-C; what is finished is kept.
    """
    campaign = file if isinstance(file, Campaign) else load_campaign(file)
    if ray is not None and ray != "local" and workers is not None:
        expected = "only one of --workers and --ray ADDRESS; a cluster has its own number"
        raise InputError("the cluster's to decide", file="--workers", value=workers, expected=expected)
    if ray is not None:
        check_address(ray)
    with folders.opened(Path(folder), campaign, resume=resume, records=records) as opened:
        before = sum(end - first for first, end in opened.done())
        if progress is not None:
            progress(before, campaign.total)
        if before < campaign.total:
            with contextlib.closing(crew_at(ray, workers or os.cpu_count() or 1)) as crew:
                run_left(opened, crew, progress)
        opened.finish()
        return Ran(campaign, opened.path, before)


def run_left(folder: Folder, crew: Crew, progress: Progress | None = None) -> None:
    """Run the remaining chunks of a campaign, and store each in its folder; the table is not made yet.

    A trial that ends its process each time it is run becomes a row that says so. The exceptions are those of
    `run_campaign`.
    """
    done = folder.done()
    count = sum(end - first for first, end in done)
    pace = Pace()
    left = pace.pieces(folders.remaining(folder.campaign.chunks(), done))
    parts = (Part(chunk, folder.records) for chunk in left)
    for part, finished in carry_out(crew, parts, apart=lambda part: part.trials):
        table = part.crashed() if finished is None else finished
        folder.keep(part.chunk, table)
        pace.note(part.chunk, rows.answer_s(table))
        count += part.chunk.count
        if progress is not None:
            progress(count, folder.campaign.total)
