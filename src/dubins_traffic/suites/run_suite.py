"""A suite is run as a campaign in its folder, and its results are written there when it is finished."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from dubins_traffic.campaign.run_campaign import Progress, run_campaign
from dubins_traffic.suites.results import save_trials
from dubins_traffic.suites.suite import Suite


def run_suite(
    suite: Suite,
    folder: str | os.PathLike[str],
    controllers: Sequence[str] = (),
    *,
    trials: int | None = None,
    workers: int | None = None,
    resume: bool = False,
    progress: Progress | None = None,
) -> Path:
    """Run the trials of a suite, or what is left of them.

    Parameters
    ----------
    suite : Suite
        One of trials.
    folder : path
        Folder of a campaign, made if missing.
    controllers : sequence of str
        What is run; those of the suite's page, if none is given.
    trials : int, optional
        Fewer trials of each combination.
    workers, resume, progress
        As for `run_campaign`.

    Returns
    -------
    path : Path
        The file of results.

    Raises
    ------
    InputError
        As `Suite.campaign` and `run_campaign`; what is finished is kept.
    KeyboardInterrupt
        On Ctrl-C; what is finished is kept.
    """
    campaign = suite.campaign(controllers or suite.controllers, trials)
    ran = run_campaign(campaign, folder, workers=workers, resume=resume, progress=progress)
    return save_trials(suite, campaign, ran.folder)
