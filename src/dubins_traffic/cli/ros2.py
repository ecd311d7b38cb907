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
def run(
    source: options.Source,
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
    controller: session.Controller = None,
    remote: session.Remote = None,
    trials: session.Trials = None,
    endless: session.Endless = False,
    lockstep: session.Lockstep = False,
    factor: session.Factor = 1.0,
    deadline: session.Deadline = 5.0,
    begin: session.Begin = 60.0,
    silence: session.Silence = 5.0,
    clock: session.Clock = False,
    seed: options.Seed = 0,
    rnd: options.Network = None,
    data: options.Data = None,
    data_over: options.DataOver = None,
    records: options.Records = None,
    shield: options.Shield = False,
    json: options.Json = False,
) -> None:
    """Be simulator, maestro and monitor of 2016 over DDS. Ctrl-C ends it and keeps all finished trials."""
    from dubins_traffic.campaign.ros2 import run_over_ros2

    todo = session.programme(
        source, controller, remote, data, data_over, trials=trials, endless=endless, seed=seed, rnd=rnd,
        records=records, shield=shield,
    )  # fmt: skip
    pace = session.pace(lockstep, factor, deadline, begin, silence)
    session.conduct(todo, run_over_ros2(todo, pace, domain=domain, here=not wide, clock=clock), json=json)
