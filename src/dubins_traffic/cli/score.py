"""`dubins-traffic score`."""

from __future__ import annotations

from typing import Annotated

import typer

from dubins_traffic.cli import options

EXAMPLES = options.examples(
    "score out/*.mcap", "score out/trial-0000.mcap --json", "score out/*.mcap --metric time_to_collision"
)


def score(
    records: Annotated[list[str], typer.Argument(metavar="RECORD...", help="Records, `*.mcap`.", show_default=False)],
    metric: options.Metrics = None,
    json: options.Json = False,
) -> None:
    """Score recorded trials, with the same code as `run` does live."""
    from dubins_traffic.cli.tables import show
    from dubins_traffic.runs.sources import load_record
    from dubins_traffic.scoring.score import ScoreSheet
    from dubins_traffic.scoring.score import score as score_record

    scores = (score_record(load_record(record), metric or ()) for record in records)
    show(ScoreSheet(tuple(scores)), json=json)
