"""Scores as rows of a data frame, with the columns of a campaign's table."""

from __future__ import annotations

from typing import Any

from dubins_traffic.campaign.rows import SCORES
from dubins_traffic.engine.batch import Batch
from dubins_traffic.runs.single import Result
from dubins_traffic.scoring.score import Score, ScoreSheet


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
    scores = {name: value(score) for name, (_, value) in SCORES.items()}
    return {**identity, **scores, **{own.column.name: own.value for own in score.metrics}}
