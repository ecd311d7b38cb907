"""`dubins-traffic warm`."""

from __future__ import annotations

from typing import Annotated

import typer

from dubins_traffic.cli import faults, options
from dubins_traffic.cli.progress import progress

EXAMPLES = options.examples("warm", "warm --all")


def warm(
    everything: Annotated[
        bool, typer.Option("--all", help="Also what is seldom needed: lasers, formulas, checks, games.")
    ] = False,
) -> None:
    """Compile beforehand what trials need; without it the first trials run interpreted, slower.

    Ctrl-C keeps what is compiled.
    """
    from dubins_traffic.checkup.precompile import precompile
    from dubins_traffic.kernels.store import cache_folder

    with progress(what="kernels") as tell:
        failed = precompile(everything=everything, progress=tell)
    for line in failed:
        faults.tell(line)
    if failed:
        raise typer.Exit(faults.FAILED)
    options.tell(f"all compiled in {cache_folder()}")
