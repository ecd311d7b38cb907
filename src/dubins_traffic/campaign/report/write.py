"""Writing the report of a campaign."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from dubins_traffic.campaign import folder as folders
from dubins_traffic.campaign import manifest, table
from dubins_traffic.campaign.report.comparison import Comparison, compare
from dubins_traffic.campaign.report.page import page
from dubins_traffic.campaign.report.sheets import sheets
from dubins_traffic.campaign.report.worst import worst as find_worst
from dubins_traffic.errors import InputError
from dubins_traffic.files import write_text

REPORT = "report"
PAGE = "index.html"


@dataclass(frozen=True, slots=True)
class Written:
    """A report: what it says, and where its page is."""

    comparison: Comparison
    page: Path


def write_report(
    folder: str | os.PathLike[str],
    output: str | os.PathLike[str] | None = None,
    *,
    worst: int = 3,
    wall: bool = False,
    progress: Callable[[int, int], object] | None = None,
) -> Written:
    """Compare the controllers of a campaign and write a page, its numbers as CSV and the replays it links to.

    The same folder gives the same bytes. An unfinished campaign is compared as far as it has come.

    Parameters
    ----------
    folder : path
        The folder of a campaign.
    output : path, optional
        Where to write; by default ``report`` in that folder.
    worst : int
        How many of the worst trials of each controller are run again and replayed.
    wall : bool
        Whether to tell what was measured on a wall clock.
    progress : callable, optional
        Is told how many of how many replays there are.

    Raises
    ------
    InputError
        If there is no campaign in `folder` or nothing of it is finished, or a file can't be written.
    MissingExtraError
        Without the extra `campaign`.
    """
    place = Path(folder)
    known = manifest.read(place)
    if known is None:
        raise InputError(
            "no campaign", file=str(place), expected="the folder of a campaign, with manifest.json"
        )
    campaign = manifest.stored_campaign(place, known)
    parts = [path for _, _, path in folders.parts(place)]
    results = table.read(place, campaign, parts)
    if not len(results):
        raise InputError("nothing is finished yet", file=str(place), expected="a campaign that has begun")
    clock = table.read(place, campaign, parts, table.Kind.WALL) if wall else None
    comparison = compare(campaign, results, clock)
    target = place / REPORT if output is None else Path(output)
    _make(target)
    bad = find_worst(campaign, results, worst, target, progress or _silent) if worst else {}
    for name, text in sheets(comparison).items():
        write_text(target / name, text)
    write_text(target / PAGE, page(comparison, known, bad))
    return Written(comparison, target / PAGE)


def _silent(_done: int, _total: int) -> None:
    """Tell nobody."""


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        problem = f"can't hold a report ({error.strerror})"
        raise InputError(problem, file=str(folder), expected="a folder, or a place for one") from None
