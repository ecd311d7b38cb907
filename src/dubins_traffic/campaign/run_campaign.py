"""Runs a campaign in its folder, from the beginning or from where it was cut off."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from dubins_traffic.campaign import folder as folders
from dubins_traffic.campaign import rows
from dubins_traffic.campaign.campaign import Campaign, load_campaign
from dubins_traffic.campaign.chunks import Pace
from dubins_traffic.campaign.folder import Folder
from dubins_traffic.campaign.worker import Part
from dubins_traffic.errors import InputError
from dubins_traffic.runs.crew import Crew, carry_out
from dubins_traffic.runs.ray_crew import check_address, crew_at

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
    with folders.opened(Path(folder), campaign, resume=resume, records=records) as own:
        before = sum(end - first for first, end in own.done())
        if progress is not None:
            progress(before, campaign.total)
        if before < campaign.total:
            with contextlib.closing(crew_at(ray, workers or os.cpu_count() or 1)) as crew:
                run_left(own, crew, progress)
        own.finish()
        return Ran(campaign, own.path, before)


def run_left(own: Folder, crew: Crew, progress: Progress | None = None) -> None:
    """Run the remaining chunks of a campaign, and store each in its folder; the table is not made yet.

    A trial that ends its process each time it is run becomes a row that says so. The exceptions are those of
    `run_campaign`.
    """
    done = own.done()
    count = sum(end - first for first, end in done)
    pace = Pace()
    left = pace.pieces(folders.remaining(own.campaign.chunks(), done))
    parts = (Part(chunk, own.records) for chunk in left)
    for part, found in carry_out(crew, parts, apart=lambda part: part.trials):
        table = part.crashed() if found is None else found
        own.keep(part.chunk, table)
        pace.note(part.chunk, rows.answer_s(table))
        count += part.chunk.count
        if progress is not None:
            progress(count, own.campaign.total)
