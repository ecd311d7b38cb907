"""`dubins-traffic replay`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Final

import typer

from dubins_traffic.cli import options
from dubins_traffic.errors import InputError

EXAMPLES = options.examples(
    "replay out/trial-0000.mcap",
    "replay out/trial-0000.mcap -o trial.html",
    "replay out/trial-0000.mcap -o trial.gif --speed 4 --to 60",
    "replay out/trial-0000.mcap --at 12.5",
)

OPTIONS: Final = {"fps": "--fps", "speed": "--speed", "start": "--from", "stop": "--to", "size": "--size"}
"""Options of moving pictures, by the parameter of `animate`."""


def replay(
    record: options.Record,
    output: Annotated[
        str | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="A page, .html, or a moving picture: .gif, .png, .mp4 or .webm.",
            show_default="RECORD.html",
        ),
    ] = None,
    fps: Annotated[
        float | None,
        typer.Option(
            "--fps",
            metavar="N",
            help="Pictures a second of a moving picture.",
            show_default="10, of a video 30",
        ),
    ] = None,
    speed: Annotated[
        float | None,
        typer.Option(
            "--speed",
            metavar="X",
            help="Seconds of the trial in a second of a moving picture.",
            show_default="1",
        ),
    ] = None,
    start: Annotated[
        float | None,
        typer.Option(
            "--from",
            metavar="S",
            help="First second of the trial in a moving picture.",
            show_default="its first",
        ),
    ] = None,
    stop: Annotated[
        float | None,
        typer.Option(
            "--to", metavar="S", help="Last second of the trial in a moving picture.", show_default="its last"
        ),
    ] = None,
    size: Annotated[
        int | None,
        typer.Option("--size", metavar="PIXELS", help="Longer side of a moving picture.", show_default="480"),
    ] = None,
    at: Annotated[
        float | None,
        typer.Option("--at", metavar="S", help="The second at which the page begins.", show_default="its first"),
    ] = None,
    overwrite: options.Replace = False,
) -> None:
    """Make a self-contained page that replays a trial in a browser, or a moving picture of it."""
    from dubins_traffic.animation.animate import CODECS, SUFFIXES, VIDEO_FPS, animate, require_moving
    from dubins_traffic.cli.progress import progress
    from dubins_traffic.cli.tables import summary
    from dubins_traffic.runs.sources import load_record
    from dubins_traffic.scoring.score import score
    from dubins_traffic.viewer.marks import formula_marks
    from dubins_traffic.viewer.pages import PAGES
    from dubins_traffic.viewer.replay import write_replay

    output = output or options.beside(record, ".html")
    suffix = Path(output).suffix.lower()
    moves = suffix in SUFFIXES
    require_moving(output, overwrite=overwrite, apart_from=[record], others=PAGES)
    given = {"fps": fps, "speed": speed, "start": start, "stop": stop, "size": size}
    chosen: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    if moves and at is not None:
        raise InputError("of a page", field="--at", value=at, expected="--from for a moving picture")
    for name, value in () if moves else chosen.items():
        expected = "no such option for a page, which plays the whole trial at any speed"
        raise InputError("of a moving picture", field=OPTIONS[name], value=value, expected=expected)
    loaded = load_record(record)
    scored = score(loaded)
    if moves:
        usual: dict[str, Any] = {"fps": VIDEO_FPS} if suffix in CODECS else {}
        moving = animate(loaded, **(usual | chosen), verdict=scored.verdict)
        with progress(len(moving), what="pictures") as tell:
            moving.write(output, overwrite=overwrite, progress=tell)
    else:
        write_replay(
            output,
            loaded.instance,
            loaded.frames,
            loaded.ending,
            summary(scored),
            formula_marks(scored.formulas),
            scored.verdict,
            overwrite=overwrite,
            at=at,
        )
    options.tell(output)
