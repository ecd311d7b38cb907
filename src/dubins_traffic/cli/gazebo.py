"""`dubins-traffic gazebo`."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

import typer

from dubins_traffic.cli import faults, options

if TYPE_CHECKING:
    from dubins_traffic.gazebo.install import Progress

INSTALL_EXAMPLES = options.examples("gazebo install", "gazebo install --prefix ~/gazebo")
DOCTOR_EXAMPLES = options.examples("gazebo doctor")

app = typer.Typer(
    help="Gazebo, the simulator with wheels, inertia and contact: install it, look whether it works.",
    no_args_is_help=True,
)

Prefix = Annotated[
    str | None,
    typer.Option(
        "--prefix",
        metavar="DIR",
        help="Folder of the installation; elsewhere named by the variable DUBINS_TRAFFIC_GAZEBO.",
        show_default="in the user's cache",
    ),
]


@app.command("install", epilog=INSTALL_EXAMPLES)
def install(prefix: Prefix = None) -> None:
    """Install Gazebo 11 into a folder of yours, without root, and check it. Interrupted, it goes on next time."""
    from dubins_traffic.gazebo import install as installer
    from dubins_traffic.gazebo.prefix import place

    folder = place(prefix)
    print(installer.announcement(folder), flush=True)
    with (
        faults.interruptible(lambda: "interrupted; the same command goes on where it stopped"),
        _progress() as progress,
    ):
        installer.install(folder, progress)
    print("Gazebo works; use it with --simulator gazebo")


@app.command("doctor", epilog=DOCTOR_EXAMPLES)
def doctor(prefix: Prefix = None) -> None:
    """Look whether Gazebo can be used, and say what is missing."""
    from dubins_traffic.gazebo.install import examine
    from dubins_traffic.gazebo.prefix import place

    well = True
    for finding in examine(place(prefix)):
        print(f"{'ok ' if finding.well else 'BAD'}  {finding.what}: {finding.seen}")
        well = well and finding.well
    if not well:
        raise typer.Exit(faults.FAILED)


@contextmanager
def _progress() -> Generator[Progress]:
    """Show each stage: as a bar to people, as lines otherwise."""
    from rich.console import Console
    from rich.progress import Progress as Bars
    from rich.progress import TaskID

    console = Console()
    with Bars(console=console, disable=not console.is_terminal) as bars:
        tasks: dict[str, TaskID] = {}

        def tell(stage: str, share: float) -> None:
            if stage not in tasks:
                tasks[stage] = bars.add_task(stage, total=1.0)
                if not console.is_terminal:
                    print(stage, flush=True)
            bars.update(tasks[stage], completed=share)

        yield tell
