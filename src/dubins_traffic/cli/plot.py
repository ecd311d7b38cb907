"""`dubins-traffic plot`."""

from __future__ import annotations

from typing import Annotated

import typer

from dubins_traffic.cli import options
from dubins_traffic.errors import InputError

EXAMPLES = options.examples(
    "plot grid.json",
    "plot out/trial-0000.mcap -o paths.pdf",
    "instance demo | dubins-traffic plot - -o instance.svg",
)


def plot(
    file: Annotated[
        str,
        typer.Argument(metavar="FILE", help="A network, an instance or a record; `-` reads it.", show_default=False),
    ],
    output: Annotated[
        str | None,
        typer.Option(
            "--output",
            "-o",
            metavar="PICTURE",
            help="PNG, SVG or PDF, by its suffix.",
            show_default="FILE.png",
        ),
    ] = None,
    overwrite: options.Replace = False,
) -> None:
    """Draw a network, an instance or a recorded trial."""
    from dubins_traffic.animation.plot import write_plot
    from dubins_traffic.problem.configuration import Configuration
    from dubins_traffic.runs.sources import load
    from dubins_traffic.viewer.figures import require_picture

    output = output or options.beside(file, ".png")
    require_picture(output, overwrite=overwrite, apart_from=[file])
    subject = load(file)
    if isinstance(subject, Configuration):
        expected = "a network, an instance or a record; `dubins-traffic instance CONFIG` draws an instance"
        raise InputError("a configuration can't be drawn", file=file, expected=expected)
    write_plot(output, subject, overwrite=overwrite)
    options.tell(output)
