"""`dubins-traffic ros1`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dubins_traffic.cli import options, session
from dubins_traffic.errors import InputError

app = typer.Typer(help="Trials over ROS 1, with the topics and services of 2016.", no_args_is_help=True)
EXAMPLES = options.examples(
    "ros1 run demo --master",
    "ros1 run my-trials.json --master --port 11411 --trials 3 --records out -f data.json",
    "ros1 run demo --remote agent0 --controller lanes --lockstep",
    "ros1 run demo --master --maestro-elsewhere --records out",
)


@app.command("run", epilog=EXAMPLES, context_settings={"allow_extra_args": True})
@session.shared
def run(
    chosen: session.SessionOptions,
    context: typer.Context,
    master: Annotated[
        bool,
        typer.Option("--master", help="Start a ROS master on this machine, at --port; without it, join one."),
    ] = False,
    port: Annotated[
        int, typer.Option("--port", metavar="PORT", min=0, max=65535, help="Of that master; 0: any free one.")
    ] = 11311,
    elsewhere: Annotated[
        bool,
        typer.Option(
            "--maestro-elsewhere",
            help="Another process, such as that of 2016, is the maestro; simulator and referee are here.",
        ),
    ] = False,
    clock: session.Clock = False,
    simulator: Annotated[
        str | None,
        typer.Option(
            "--simulator",
            metavar="S",
            help="What moves the cars; ros1-world: they are in a world that is not ours.",
        ),
    ] = None,
    poses: Annotated[
        str | None,
        typer.Option(
            "--poses", metavar="TOPIC", help="Of that world: PoseStamped of each car, {} for its name."
        ),
    ] = None,
) -> None:
    """Be simulator, maestro and monitor of 2016 in one process. Ctrl-C ends it and keeps all finished trials."""
    from dubins_traffic.sessions.ros1 import run_over_ros1

    _check_remappings(context.args)
    world = _is_world(simulator, poses)
    todo = chosen.session_plan(None if world else simulator)
    at = port if master else None
    results = run_over_ros1(
        todo, chosen.pace(), master=at, clock=clock, world=world, poses=poses, elsewhere=elsewhere
    )
    session.run_session(todo, results, json=chosen.json)


@app.command("messages", epilog=options.examples("ros1 messages build/ros --cpp"))
def messages(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Where to write, made if missing.", show_default=False)
    ],
    cpp: Annotated[bool, typer.Option("--cpp", help="C++ headers instead of Python packages.")] = False,
) -> None:
    """Write the message packages that Debian lacks: gazebo_msgs, dubins_traffic_msgs, integrator_chains_msgs."""
    from dubins_traffic.transports.ros1.messages import write_cpp, write_python

    (write_cpp if cpp else write_python)(folder)
    options.tell(str(folder))


def _is_world(simulator: str | None, poses: str | None) -> bool:
    """Tell whether the cars are in another world."""
    if poses is not None and simulator != "ros1-world":
        raise InputError(
            "is of another world", file="--poses", value=poses, expected="--simulator ros1-world"
        )
    return simulator == "ros1-world"


def _check_remappings(arguments: list[str]) -> None:
    """Let what roslaunch adds to a command line pass: `__name:=...`, `__log:=...`."""
    for argument in arguments:
        if ":=" not in argument:
            raise InputError(
                "not an argument", file="ros1 run", value=argument, expected="name:=value at most"
            )
