"""`dubins-traffic ros2`."""

from __future__ import annotations

from typing import Annotated

import typer

from dubins_traffic.cli import options, session

app = typer.Typer(
    help="Trials over ROS 2 by DDS, with the topics of 2016 and its mode service.", no_args_is_help=True
)
EXAMPLES = options.examples(
    "ros2 run demo",
    "ros2 run my-trials.json --domain 7 --trials 3 --records out",
    "ros2 run demo --remote agent0 --controller lanes --lockstep",
)


@app.command("run", epilog=EXAMPLES)
@session.shared
def run(
    chosen: session.SessionOptions,
    domain: Annotated[
        int | None,
        typer.Option(
            "--domain", metavar="N", min=0, max=232, help="DDS domain.", show_default="$ROS_DOMAIN_ID, else 0"
        ),
    ] = None,
    wide: Annotated[
        bool,
        typer.Option("--wide", help="Beyond this machine, as $CYCLONEDDS_URI or Cyclone's defaults say."),
    ] = False,
    clock: session.Clock = False,
) -> None:
    """Be simulator, maestro and monitor of 2016 over DDS. Ctrl-C ends it and keeps all finished trials."""
    from dubins_traffic.sessions.ros2 import run_over_ros2

    todo = chosen.session_plan()
    session.run_session(
        todo, run_over_ros2(todo, chosen.pace(), domain=domain, here=not wide, clock=clock), json=chosen.json
    )
