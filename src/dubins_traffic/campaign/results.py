"""Results for notebooks and data frames: those of a campaign, read from its folder, and scores as rows of its table."""

from __future__ import annotations

import os
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dubins_traffic.campaign import folder as folders
from dubins_traffic.campaign import manifest, table
from dubins_traffic.campaign.campaign import Campaign
from dubins_traffic.campaign.columns import SCORES
from dubins_traffic.display import pandas
from dubins_traffic.engine.batch import Batch
from dubins_traffic.errors import InputError
from dubins_traffic.runs.single import Result
from dubins_traffic.scoring.score import Score, ScoreSheet, outcome
from dubins_traffic.viewer.notebook import shares_html


@dataclass(frozen=True, slots=True)
class CampaignResults:
    """The results of a campaign so far.

    Attributes
    ----------
    folder : Path
        Where it is.
    campaign : Campaign
        What is run.
    table : pyarrow.Table
        One row a trial that is done (docs/campaigns.md).
    """

    folder: Path
    campaign: Campaign
    table: Any

    def __len__(self) -> int:
        return len(self.table)

    def __repr__(self) -> str:
        return f"<CampaignResults {self.folder}: {self._trials_text()}>"

    def _repr_html_(self) -> str:
        shares = {name: Counter[str]() for name in self.campaign.controllers}
        columns = (self.table[name].to_pylist() for name in ("controller", "verdict", "end"))
        for controller, verdict, end in zip(*columns, strict=True):
            shares[controller][outcome(verdict, end)] += 1
        return shares_html("Campaign", f"{self.folder}: {self._trials_text()}", shares)

    def asdict(self) -> dict[str, list[Any]]:
        """Return the table as a dict of columns: name to values, one a trial."""
        return self.table.to_pydict()

    def to_pandas(self) -> Any:
        """Return the table as a pandas `DataFrame` with one row a trial.

        Raises
        ------
        MissingExtraError
            If pandas is not installed.
        """
        pandas()
        return self.table.to_pandas()

    def _trials_text(self) -> str:
        names = ", ".join(self.campaign.controllers)
        return f"{len(self)} of {self.campaign.total} trials of {names}"


def load_results(folder: str | os.PathLike[str]) -> CampaignResults:
    """Return the results of a campaign; of one that is not finished those that there are.

    Raises
    ------
    InputError
        If there is no campaign in `folder`, or its table can't be read.
    MissingExtraError
        Without the extra `campaign`.
    """
    place = Path(folder)
    known = manifest.read(place)
    if known is None:
        expected = "the folder of a campaign, with manifest.json"
        raise InputError("no campaign", file=str(place), expected=expected)
    campaign = manifest.stored_campaign(place, known)
    parts = [path for _, _, path in folders.parts(place)]
    return CampaignResults(place, campaign, table.read(place, campaign, parts))


def rows_of(subject: object) -> list[dict[str, Any]]:
    """Return one row a trial of a score, a score sheet, the result of a trial or a batch."""
    if isinstance(subject, Score):
        return [_row(subject)]
    if isinstance(subject, ScoreSheet):
        return [_row(score) for score in subject.trials]
    if isinstance(subject, Result):
        return [_row(subject.score)]
    if isinstance(subject, Batch):
        return [_row(outcome.score) for outcome in subject.outcomes]
    raise TypeError(f"no table of a {type(subject).__name__}")


def _row(score: Score) -> dict[str, Any]:
    identity = {name: getattr(score, name) for name in ("trial", "seed", "controller", "record", "end")}
    scores = {name: kind.of(score) for name, kind in SCORES.items()}
    return {**identity, **scores, **{metric.column.name: metric.value for metric in score.metrics}}
