"""`dubins-traffic play`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dubins_traffic.cli import faults, maps, options
from dubins_traffic.errors import needs

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

EXAMPLES = options.examples(
    "play",
    "play town --seed 4 -o mine.mcap",
    "play junction --pace 0.5",
    "play out/trial-0003.mcap",
    "play suburb --no-browser --port 8765",
)
RECORDS = (".mcap",)

ConfigArgument = Annotated[
    str,
    typer.Argument(
        metavar="[CONFIG|INSTANCE|RECORD]",
        help="Where to drive: a trials configuration (file or shipped name), an instance, or the trial of a record.",
        autocompletion=options.shipped,
    ),
]
TrialOption = Annotated[
    int, typer.Option("--trial", metavar="N", min=0, help="Number of the trial of a configuration.")
]
RecordOption = Annotated[
    str | None, typer.Option("--output", "-o", metavar="RECORD", help="Keep the record here, *.mcap.")
]


def play(
    source: ConfigArgument = "junction",
    seed: options.Seed = 0,
    trial: TrialOption = 0,
    rnd: options.Network = None,
    output: RecordOption = None,
    overwrite: options.Replace = False,
    pace: options.Pace = 1.0,
    port: options.Port = 0,
    no_browser: options.NoBrowser = False,
    json: options.Json = False,
) -> None:
    """Drive the ego yourself, in a page of the browser: keys, a game pad or touch.

    Breaches and whose turn it is are shown at once; at the end the verdict,
    and your place beside `simple`, `lanes` and `rules` on the same trial.
    Closing the page ends the trial as interrupted.
    """
    with needs("driving in a page", "watch"):
        from dubins_traffic.live import playing
        from dubins_traffic.live.stage import Stage
    from dubins_traffic.cli.tables import show, summary
    from dubins_traffic.scoring.score import ScoreSheet

    options.require(output, "a record", RECORDS, overwrite=overwrite, apart_from=[source])
    instance = _instance(source, rnd, seed, trial)
    stage = Stage(options.tell, port, opens=not no_browser, pace=pace, plays=True)
    record = None if output is None else Path(output)
    left = "the page was closed: the trial is interrupted"
    try:
        with faults.interruptible(lambda: left if stage.wheel.left else "interrupted"), stage:
            _, standings = playing.play(stage, instance, summary, record, overwrite=overwrite)
    except typer.Exit:
        if record is not None and record.exists():
            options.tell(str(record))
        raise
    show(ScoreSheet(tuple(standing.score for standing in standings)), json=json)
    options.tell(playing.sentence(standings), *([] if output is None else [output]))


def _instance(source: str, rnd: str | None, seed: int, trial: int) -> Instance:
    """Return the trial to drive."""
    from dubins_traffic.problem.configuration import Configuration
    from dubins_traffic.problem.draw import draw
    from dubins_traffic.record.reader import Record
    from dubins_traffic.runs.plan import load_runnable

    runnable = load_runnable(source, rnd=rnd, seed=seed)
    if isinstance(runnable, Record):
        return runnable.instance
    if isinstance(runnable, Configuration):
        maps.report(runnable.network)
        return draw(runnable, seed, trial)
    return runnable
