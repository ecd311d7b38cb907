"""`dubins-traffic build`, and `warm`, which was its name."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from dubins_traffic.cli import faults, options
from dubins_traffic.cli.progress import progress
from dubins_traffic.errors import InputError

EXAMPLES = options.examples("build", "build --level x86-64-v2")
WARM_EXAMPLES = options.examples("warm")


def build(
    level: Annotated[
        str | None,
        typer.Option(help="For another level of processors: x86-64-v2, -v3 or -v4.", show_default="this one's"),
    ] = None,
    folder: Annotated[
        Path | None,
        typer.Option(help="Folder of the library.", show_default="where all commands of this user find it"),
    ] = None,
) -> None:
    """Build the library of machine code: all kernels, in one process. Needs the extra `compile`.

    Wheels have it. Without it kernels run interpreted until each is compiled beside. Ctrl-C keeps what is compiled.
    """
    from dubins_traffic.kernels.levels import LEVEL, LEVELS

    if level is not None:
        if level not in LEVELS:
            raise InputError("no such level", file="--level", value=level, expected=", ".join(LEVELS))
        os.environ[LEVEL] = level
    _build(folder)


def warm(
    everything: Annotated[bool, typer.Option("--all", help="As without it.", hidden=True)] = False,  # noqa: ARG001
) -> None:
    """Do as `build` does, which has taken the place of this command."""
    faults.warn("warm is deprecated: dubins-traffic build has taken its place")
    _build(None)


def _build(folder: Path | None) -> None:
    from dubins_traffic.compiling.building import build

    with progress(what="kernels") as tell:
        built = build(folder, tell)
    for line in built.failed:
        faults.tell(line)
    if built.failed:
        raise typer.Exit(faults.FAILED)
    if built.library is None:
        options.tell(f"{built.kernels} kernels, each in a file of its own: {built.reason}")
    else:
        options.tell(f"{built.kernels} kernels in {built.library}")
