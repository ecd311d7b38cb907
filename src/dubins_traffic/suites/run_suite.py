"""Runs a suite as a campaign in a folder, and writes its results there when it is finished."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from dubins_traffic.campaign import rows
from dubins_traffic.campaign.report.plots import figures
from dubins_traffic.campaign.report.statistics import distributions
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
    """Run the trials of a suite, or the remaining ones, and write the results.

    Parameters
    ----------
    suite : Suite
        A suite of trials.
    folder : path
        Folder of a campaign, made if missing.
    controllers : sequence of str
        The controllers to run; by default those of the suite's page.
    trials : int, optional
        Number of trials of each combination, if fewer are to be run.
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
    MissingExtraError
        Without what a page of results needs; nothing is written then.
    KeyboardInterrupt
        On Ctrl-C; what is finished is kept.
    """
    rows.arrow()
    figures()
    distributions()
    campaign = suite.campaign(controllers or suite.controllers, trials)
    ran = run_campaign(campaign, folder, workers=workers, resume=resume, progress=progress)
    return save_trials(suite, campaign, ran.folder)
