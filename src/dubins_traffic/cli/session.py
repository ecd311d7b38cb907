"""What the commands that run trials over a transport share: their options, and how they go."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import wraps
from inspect import Parameter, Signature, signature
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from dubins_traffic.cli import faults, options

if TYPE_CHECKING:
    from dubins_traffic.runs.single import Result
    from dubins_traffic.sessions.plan import Pace, SessionPlan

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


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionOptions:
    """What the options say that all of these commands share."""

    source: options.Source
    controller: Controller = None
    remote: Remote = None
    trials: Trials = None
    endless: Endless = False
    lockstep: Lockstep = False
    factor: Factor = 1.0
    deadline: Deadline = 5.0
    begin: Begin = 60.0
    silence: Silence = 5.0
    seed: options.Seed = 0
    rnd: options.Network = None
    data: options.Data = None
    data_over: options.DataOver = None
    records: options.Records = None
    overwrite: options.Overwrite = False
    append: options.Append = False
    shield: options.Shield = False
    json: options.Json = False

    def session_plan(self, simulator: str | None = None) -> SessionPlan:
        """Return what the session shall run."""
        from dubins_traffic.sessions.plan import session_plan

        todo = session_plan(
            self.source, self.controller, trials=self.trials, endless=self.endless, seed=self.seed, rnd=self.rnd,
            remote=self.remote or (), data=options.trial_data(self.data, self.data_over),
            overwrite_data=self.data is None, records=self.records, overwrite=self.overwrite, append=self.append,
            simulator=simulator, shield=self.shield,
        )  # fmt: skip
        return replace(todo, say=faults.tell)

    def pace(self) -> Pace:
        """Return how drivers are waited for."""
        from dubins_traffic.sessions.plan import Pace
        from dubins_traffic.transports.patience import Patience

        patience = Patience(begin=self.begin, silence=self.silence)
        return Pace(self.lockstep, self.factor, self.deadline, patience)


def shared(own: Callable[..., None]) -> Callable[..., None]:
    """Return a command with the options of `own`, except its first parameter, and those of `SessionOptions`.

    `own` is given these as its first argument. The library reads options off a signature, so this makes one.
    """

    @wraps(own)
    def command(**given: Any) -> None:
        chosen = SessionOptions(**{name: given.pop(name) for name in hints})
        own(chosen, **given)

    hints = get_type_hints(SessionOptions, include_extras=True)
    own_hints = get_type_hints(own, include_extras=True)
    _, *rest = signature(own).parameters.values()
    parameters = [
        *(one.replace(kind=Parameter.KEYWORD_ONLY, annotation=own_hints[one.name]) for one in rest),
        *(one.replace(annotation=hints[one.name]) for one in signature(SessionOptions).parameters.values()),
    ]
    command.__signature__ = Signature(parameters)  # pyright: ignore[reportAttributeAccessIssue]
    command.__annotations__ = {one.name: one.annotation for one in parameters}
    return command


def run_session(todo: SessionPlan, session: Iterable[Result], *, json: bool) -> None:
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
