"""Runs a suite as a campaign in a folder, strangers' controllers in boxes, and writes its results there at the end."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from dubins_traffic.campaign import rows
from dubins_traffic.campaign.report.plots import figures
from dubins_traffic.campaign.report.statistics import distributions
from dubins_traffic.campaign.run_campaign import Progress, run_campaign
from dubins_traffic.controllers import registry as controllers_by_name
from dubins_traffic.errors import InputError
from dubins_traffic.sandbox.available import available_layers
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


def seated(specs: Sequence[str]) -> tuple[list[str], str]:
    """Return controllers with a box for each whose code is not ours, and a notice on those for which there is none.

    Parameters
    ----------
    specs : sequence of str
        Names of controllers; those that ask for a box have it already.

    Returns
    -------
    specs : list of str
        The names with which they run.
    notice : str
        Says which run in this process, trusted, since this machine has no boxes; empty if none does.
    """
    strangers = [
        spec
        for spec in specs
        if controllers_by_name.ran(spec) == controllers_by_name.IN_PROCESS
        and not controllers_by_name.is_ours(spec)
    ]
    if not strangers:
        return list(specs), ""
    try:
        available_layers().require()
    except InputError as error:
        return list(specs), f"{', '.join(strangers)}: in process, trusted, since {error.problem}"
    return [controllers_by_name.sandboxed(spec) if spec in strangers else spec for spec in specs], ""
