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
from dubins_traffic.campaign.chunks import Chunk, Pace
from dubins_traffic.campaign.engines import Engine
from dubins_traffic.campaign.folder import Folder
from dubins_traffic.campaign.pool import Pool
from dubins_traffic.campaign.ray_engine import RayEngine, check_address
from dubins_traffic.campaign.schedule import carry_out
from dubins_traffic.campaign.worker import Surroundings
from dubins_traffic.errors import InputError

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
            around = Surroundings.here(own.records)
            with contextlib.closing(_engine(workers, ray, around)) as engine:
                run_left(own, engine, progress)
        own.finish()
        return Ran(campaign, own.path, before)


def run_left(own: Folder, engine: Engine[Chunk], progress: Progress | None = None) -> None:
    """Run the remaining chunks of a campaign on `engine`, and store each in its folder; the table is not made yet.

    The exceptions are those of `run_campaign`.
    """
    done = own.done()
    count = sum(end - first for first, end in done)
    pace = Pace()
    for chunk, part in carry_out(engine, pace.pieces(folders.remaining(own.campaign.chunks(), done))):
        own.keep(chunk, part)
        pace.note(chunk, rows.answer_s(part))
        count += chunk.count
        if progress is not None:
            progress(count, own.campaign.total)


def _engine(workers: int | None, ray: str | None, around: Surroundings) -> Engine[Chunk]:
    count = workers or os.cpu_count() or 1
    return Pool(count, around) if ray is None else RayEngine(ray, count, around)
