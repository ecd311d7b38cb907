"""`dubins-traffic score`."""

from __future__ import annotations

from typing import Annotated

import typer

from dubins_traffic.cli import options

EXAMPLES = options.examples("score out/*.mcap", "score out/trial-0000.mcap --json")


def score(
    records: Annotated[
        list[str], typer.Argument(metavar="RECORD...", help="Records, `*.mcap`.", show_default=False)
    ],
    json: options.Json = False,
) -> None:
    """Score recorded trials, with the same code as `run` does live."""
    from dubins_traffic.cli.tables import show
    from dubins_traffic.runs.sources import load_record
    from dubins_traffic.scoring.score import ScoreSheet
    from dubins_traffic.scoring.score import score as score_record

    show(ScoreSheet(tuple(score_record(load_record(record)) for record in records)), json=json)
