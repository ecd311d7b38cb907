"""A person drives the ego through one trial, and is told the verdict and his place beside the built-in controllers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from dubins_traffic.live.stage import Stage
from dubins_traffic.problem.instance import Instance
from dubins_traffic.runs.single import Result, run_trial
from dubins_traffic.scoring.score import Score

NAME: Final = "play"
"""Name of a person as controller, in records and scores."""
RIVALS: Final = ("simple", "lanes", "rules")
"""The controllers that a person is compared with."""
PLACES: Final = ("first", "second", "third", "fourth")
"""The places of a person and three rivals, in words."""


@dataclass(frozen=True, slots=True)
class Standing:
    """The place of one driver in one trial: from 1; who has as many rounds of either kind shares it."""

    place: int
    score: Score


def play(
    stage: Stage,
    instance: Instance,
    summarise: Callable[[Score], Mapping[str, object]],
    record: Path | None = None,
    *,
    overwrite: bool = False,
) -> tuple[Result, list[Standing]]:
    """Let a person drive the ego through `instance`, then the `RIVALS`, each alone; tell the page of it all.

    Parameters
    ----------
    stage : Stage
        The page on which he drives.
    instance : Instance
        The trial.
    summarise : callable
        Returns what is shown of a score, name to value.
    record : Path, optional
        Where to write the record.
    overwrite : bool
        Whether an existing record may be replaced.

    Returns
    -------
    result : Result
        The person's.
    standings : list of Standing
        Of all, best first.

    Raises
    ------
    LeftError
        If the person has closed the page; the trial has ended as interrupted, and its record is whole.
    """
    feed = stage.feed
    result = run_trial(
        instance, stage.player, record=record, overwrite=overwrite, sketch=False, name=NAME, watchers=(feed,)
    )
    feed.end(instance, result.ending, summarise(result.score), result.score.verdict)
    names = ", ".join(RIVALS[:-1])
    feed.tell({"kind": "places", "rows": [], "sentence": f"{names} and {RIVALS[-1]} are driving the same trial ..."})
    scores = [result.score, *(run_trial(instance, name, sketch=False).score for name in RIVALS)]
    ranked = standings(scores)
    feed.tell({"kind": "places", "rows": [_row(standing) for standing in ranked], "sentence": sentence(ranked)})
    return result, ranked


def standings(scores: Sequence[Score]) -> list[Standing]:
    """Rank the scores of one trial: by counted rounds and then by rounds before the first breach (docs/scores.md)."""
    merit = {score.controller: (score.counted_rounds, score.rounds_before_breach) for score in scores}
    return [
        Standing(1 + sum(other > merit[score.controller] for other in merit.values()), score)
        for score in sorted(scores, key=lambda score: merit[score.controller], reverse=True)
    ]


def sentence(standings: Sequence[Standing]) -> str:
    """Return in a sentence which place the person has."""
    ours = next(standing for standing in standings if standing.score.controller == NAME)
    equal = [str(other.score.controller) for other in standings if other.place == ours.place and other is not ours]
    shared = f", level with {' and '.join(equal)}" if equal else ""
    return f"You came {PLACES[ours.place - 1]} of four{shared}."


def _row(standing: Standing) -> dict[str, object]:
    score = standing.score
    is_person = score.controller == NAME
    cells = [
        "you" if is_person else str(score.controller),
        str(standing.place),
        str(score.counted_rounds),
        f"{score.rounds_before_breach:.2f}",
        score.outcome.replace("_", " "),
    ]
    return {"cells": cells, "you": is_person}
