"""`dubins-traffic replay`."""

from __future__ import annotations

from typing import Annotated

import typer

from dubins_traffic.cli import options

EXAMPLES = options.examples(
    "replay out/trial-0000.mcap",
    "replay out/trial-0000.mcap -o trial.html",
    "replay out/trial-0000.mcap --at 12.5",
)


def replay(
    record: options.Record,
    output: Annotated[
        str | None,
        typer.Option("--output", "-o", metavar="FILE.html", help="The page.", show_default="RECORD.html"),
    ] = None,
    at: Annotated[
        float | None,
        typer.Option(
            "--at", metavar="S", help="The second at which the page begins.", show_default="its first"
        ),
    ] = None,
    overwrite: options.Replace = False,
) -> None:
    """Make one self-contained page that replays a trial in a browser: play, pause, scrub, speed, trails."""
    from dubins_traffic.cli.tables import summary
    from dubins_traffic.runs.sources import load_record
    from dubins_traffic.scoring.score import score
    from dubins_traffic.viewer.marks import formula_marks
    from dubins_traffic.viewer.pages import PAGES
    from dubins_traffic.viewer.replay import write_replay

    output = output or options.beside(record, ".html")
    options.require(output, "a page", PAGES, overwrite=overwrite, apart_from=[record])
    found = load_record(record)
    scored = score(found)
    write_replay(
        output,
        found.instance,
        found.frames,
        found.ending,
        summary(scored),
        formula_marks(scored.formulas),
        scored.verdict,
        overwrite=overwrite,
        at=at,
    )
    options.tell(output)
