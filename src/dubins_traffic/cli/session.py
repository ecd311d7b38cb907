"""What the commands that run trials over a transport share: their options, and how they go."""

from __future__ import annotations

import signal
from collections.abc import Iterable
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dubins_traffic.cli import faults, options

if TYPE_CHECKING:
    from dubins_traffic.campaign.sessions import Pace, Programme
    from dubins_traffic.campaign.single import Result

Controller = Annotated[
    str | None,
    typer.Option(
        "--controller",
        metavar="C",
        help="Drives the ego in this process.",
        show_default="a program elsewhere drives it",
        autocompletion=options.controllers,
    ),
]
Remote = Annotated[
    list[str] | None,
    typer.Option("--remote", metavar="NAME", help="An e-agent that is driven elsewhere; may be repeated."),
]
Trials = Annotated[
    int | None,
    typer.Option("--trials", metavar="N", min=1, help="How many.", show_default="as the configuration says"),
]
Endless = Annotated[bool, typer.Option("--endless", help="Run trials until interrupted.")]
Lockstep = Annotated[
    bool, typer.Option("--lockstep", help="Wait for a command of every remote car each tick.")
]
Factor = Annotated[
    float, typer.Option("--factor", metavar="F", help="How many times as fast as the wall clock.")
]
Deadline = Annotated[float, typer.Option("--deadline", metavar="SECONDS", help="For a command, in lockstep.")]
Begin = Annotated[
    float, typer.Option("--begin", metavar="SECONDS", help="For the first command after the instance.")
]
Silence = Annotated[
    float, typer.Option("--silence", metavar="SECONDS", help="Without any command, in real time.")
]

Clock = Annotated[
    bool, typer.Option("--clock", help="Publish /clock, and stamp messages with simulated time.")
]


def programme(
    source: str,
    controller: str | None,
    remote: list[str] | None,
    data: str | None,
    data_over: str | None,
    **more: Any,
) -> Programme:
    """Return what a session shall run, as its command's options say; `more` as for `campaign.sessions.programme`."""
    from dubins_traffic.campaign.sessions import programme

    file = options.trial_data(data, data_over)
    return programme(source, controller, remote=remote or (), data=file, overwrite_data=data is None, **more)


def pace(lockstep: bool, factor: float, deadline: float, begin: float, silence: float) -> Pace:
    """Return how drivers are waited for, as a command's options say."""
    from dubins_traffic.campaign.sessions import Pace
    from dubins_traffic.transports.link import Patience

    return Pace(lockstep, factor, deadline, Patience(begin=begin, silence=silence))


def conduct(todo: Programme, session: Iterable[Result], *, json: bool) -> None:
    """Run a session's trials, say how each ended and show the scores; SIGTERM ends it as Ctrl-C does."""
    from dubins_traffic.cli.tables import show
    from dubins_traffic.record.sink import FAULTS

    results: list[Result] = []
    signal.signal(signal.SIGTERM, _interrupt)
    try:
        for result in session:
            results.append(result)
            ending = f"{result.ending.end}: {result.ending.detail}".rstrip(": ")
            faults.tell(f"trial {result.instance.trial}: {ending}")
    except KeyboardInterrupt:
        faults.tell(f"interrupted after {len(results)} trials")
        raise
    finally:
        if results:
            show(todo.conclude(results), json=json)
    if any(result.ending.end in FAULTS for result in results):
        raise typer.Exit(faults.FAILED)


def _interrupt(_signal: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt
