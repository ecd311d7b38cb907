"""`dubins-traffic ros1`."""

from __future__ import annotations

import signal
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated

import typer

from dubins_traffic.cli import faults, options
from dubins_traffic.errors import InputError

if TYPE_CHECKING:
    from dubins_traffic.campaign.single import Result

app = typer.Typer(help="Trials over ROS 1, with the topics and services of 2016.", no_args_is_help=True)
EXAMPLES = options.examples(
    "ros1 run demo --master",
    "ros1 run my-trials.json --master 11411 --trials 3 --records out -f data.json",
    "ros1 run demo --remote agent0 --controller lanes --lockstep",
)


@app.command("run", epilog=EXAMPLES, context_settings={"allow_extra_args": True})
def run(
    context: typer.Context,
    source: Annotated[
        str,
        typer.Argument(
            metavar="CONFIG|INSTANCE|RECORD",
            help="A trials configuration (file or shipped name), an instance or a record; told by its content.",
            show_default=False,
            autocompletion=options.shipped,
        ),
    ],
    controller: Annotated[
        str | None,
        typer.Option(
            "--controller",
            metavar="C",
            help="Drives the ego in this process.",
            show_default="a node drives it",
            autocompletion=options.controllers,
        ),
    ] = None,
    remote: Annotated[
        list[str] | None,
        typer.Option("--remote", metavar="NAME", help="An e-agent that a node drives; may be repeated."),
    ] = None,
    trials: Annotated[
        int | None,
        typer.Option(
            "--trials", metavar="N", min=1, help="How many.", show_default="as the configuration says"
        ),
    ] = None,
    endless: Annotated[bool, typer.Option("--endless", help="Run trials until interrupted.")] = False,
    master: Annotated[
        bool,
        typer.Option("--master", help="Start a ROS master on this machine, at --port; without it, join one."),
    ] = False,
    port: Annotated[
        int, typer.Option("--port", metavar="PORT", min=0, max=65535, help="Of that master; 0: any free one.")
    ] = 11311,
    lockstep: Annotated[
        bool, typer.Option("--lockstep", help="Wait for a command of every remote car each tick.")
    ] = False,
    factor: Annotated[
        float, typer.Option("--factor", metavar="F", help="How many times as fast as the wall clock.")
    ] = 1.0,
    deadline: Annotated[
        float, typer.Option("--deadline", metavar="SECONDS", help="For a command, in lockstep.")
    ] = 5.0,
    begin: Annotated[
        float, typer.Option("--begin", metavar="SECONDS", help="For the first command after the instance.")
    ] = 60.0,
    silence: Annotated[
        float, typer.Option("--silence", metavar="SECONDS", help="Without any command, in real time.")
    ] = 5.0,
    clock: Annotated[
        bool, typer.Option("--clock", help="Publish /clock, and stamp messages with simulated time.")
    ] = False,
    simulator: Annotated[
        str | None,
        typer.Option(
            "--simulator", metavar="S", help="ros1-world: the cars are in a world that is not ours."
        ),
    ] = None,
    poses: Annotated[
        str | None,
        typer.Option(
            "--poses", metavar="TOPIC", help="Of that world: PoseStamped of each car, {} for its name."
        ),
    ] = None,
    seed: options.Seed = 0,
    rnd: Annotated[
        str | None,
        typer.Option("--rnd", metavar="FILE", help="A road network instead of the configuration's."),
    ] = None,
    data: Annotated[
        str | None,
        typer.Option("-f", metavar="DATA", help="Write the trial data file of 2016; don't overwrite one."),
    ] = None,
    data_over: Annotated[
        str | None, typer.Option("-F", metavar="DATA", help="The same, overwriting one.")
    ] = None,
    records: Annotated[
        str | None, typer.Option("--records", metavar="DIR", help="Folder for the records, made if missing.")
    ] = None,
    json: options.Json = False,
) -> None:
    """Be simulator, maestro and monitor of 2016 in one process. Ctrl-C ends it and keeps all finished trials."""
    from dubins_traffic.campaign.ros1 import Terms, run_over_ros1
    from dubins_traffic.campaign.sessions import programme
    from dubins_traffic.cli.tables import show
    from dubins_traffic.record.sink import FAULTS
    from dubins_traffic.transports.link import Patience

    _check_remappings(context.args)
    if data is not None and data_over is not None:
        raise InputError("two trial data files", file="-F", value=data_over, expected="either -f or -F")
    todo = programme(
        source, controller, trials=trials, endless=endless, seed=seed, rnd=rnd, remote=remote or (),
        data=data or data_over, overwrite_data=data is None, records=records,
    )  # fmt: skip
    world = _is_world(simulator, poses)
    patience = Patience(begin=begin, silence=silence)
    terms = Terms(port if master else None, lockstep, factor, deadline, patience, clock, world, poses)
    results: list[Result] = []
    signal.signal(signal.SIGTERM, _interrupt)
    try:
        for result in run_over_ros1(todo, terms):
            results.append(result)
            faults.tell(
                f"trial {result.instance.trial}: {result.ending.end}: {result.ending.detail}".rstrip(": ")
            )
    except KeyboardInterrupt:
        faults.tell(f"interrupted after {len(results)} trials")
        raise
    finally:
        if results:
            show(todo.conclude(results), json=json)
    if any(result.ending.end in FAULTS for result in results):
        raise typer.Exit(faults.FAILED)


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
    if simulator not in (None, "embedded", "ros1-world"):
        raise InputError(
            "not a simulator over ROS 1", file="--simulator", value=simulator, expected="ros1-world"
        )
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


def _interrupt(_signal: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt
