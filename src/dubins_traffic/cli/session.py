"""The commands that run trials over a transport: their common options, and how they run a session."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from inspect import Parameter, Signature, signature
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from dubins_traffic.cli import faults, options
from dubins_traffic.errors import InputError

if TYPE_CHECKING:
    from dubins_traffic.runs.single import Result
    from dubins_traffic.sessions.plan import Pace, SessionPlan
    from dubins_traffic.sessions.registry import Option, TransportEntry

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
Endless = Annotated[bool, typer.Option("--endless", help="Run trials until interrupted.")]
Lockstep = Annotated[bool, typer.Option("--lockstep", help="Wait for a command of every remote car in each tick.")]
Factor = Annotated[
    float, typer.Option("--factor", metavar="F", help="Speed of simulated time relative to the wall clock.")
]
Deadline = Annotated[
    float, typer.Option("--deadline", metavar="SECONDS", help="Longest wait for a command, in lockstep.")
]
Begin = Annotated[
    float,
    typer.Option("--begin", metavar="SECONDS", help="Longest wait for the first command after the announcement."),
]
Silence = Annotated[
    float,
    typer.Option("--silence", metavar="SECONDS", help="Longest time without any command, in real time."),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionOptions:
    """The values of the options that all of these commands share."""

    source: options.Source
    controller: Controller = None
    remote: Remote = None
    trials: options.Trials = None
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

    def session_plan(self) -> SessionPlan:
        """Return the plan of the session."""
        from dubins_traffic.sessions.plan import session_plan

        todo = session_plan(
            self.source, self.controller, trials=self.trials, endless=self.endless, seed=self.seed, rnd=self.rnd,
            remote=self.remote or (), data=options.trial_data(self.data, self.data_over),
            overwrite_data=self.data is None, records=self.records, overwrite=self.overwrite, append=self.append,
            shield=self.shield,
        )  # fmt: skip
        return replace(todo, say=faults.tell)

    def pace(self) -> Pace:
        """Return the pace of the session: its clock, and how long drivers are waited for."""
        from dubins_traffic.sessions.plan import Pace
        from dubins_traffic.transports.clocks import Patience

        patience = Patience(begin=self.begin, silence=self.silence)
        return Pace(self.lockstep, self.factor, self.deadline, patience)


def app(name: str, entry: TransportEntry) -> typer.Typer:
    """Return the command of a transport, with its `run`."""
    made = typer.Typer(help=entry.line, no_args_is_help=True)
    settings = {"allow_extra_args": True} if entry.remappings else None
    made.command("run", epilog=options.examples(*entry.examples), context_settings=settings)(command(name, entry))
    return made


def command(name: str, entry: TransportEntry) -> Callable[..., None]:
    """Return the function that runs a session over a transport, with its own options and those of `SessionOptions`.

    Typer reads options off a signature, so this function makes one.
    """

    def run(**given: Any) -> None:
        context: typer.Context = given.pop("context")
        chosen = SessionOptions(**{name: given.pop(name) for name in hints})
        _check_remappings(name, context.args)
        todo = chosen.session_plan()
        run_session(todo, entry.runner(todo, chosen.pace(), **given), json=chosen.json)

    hints = get_type_hints(SessionOptions, include_extras=True)
    parameters = [
        Parameter("context", Parameter.KEYWORD_ONLY, annotation=typer.Context),
        *map(_parameter, entry.options),
        *(one.replace(annotation=hints[one.name]) for one in signature(SessionOptions).parameters.values()),
    ]
    run.__doc__ = entry.about
    run.__signature__ = Signature(parameters)  # pyright: ignore[reportFunctionMemberAccess]
    run.__annotations__ = {one.name: one.annotation for one in parameters}
    return run


def _parameter(option: Option) -> Parameter:
    """Return an option of a transport as a parameter for Typer."""
    kind: Any = option.kind if option.default is not None else option.kind | None
    shown: Any = {} if option.shown is None else {"show_default": option.shown}
    said = typer.Option(option.flag, metavar=option.metavar, min=option.low, max=option.high, help=option.help, **shown)
    return Parameter(option.parameter, Parameter.KEYWORD_ONLY, default=option.default, annotation=Annotated[kind, said])


def _check_remappings(name: str, arguments: list[str]) -> None:
    """Let what roslaunch adds to a command line pass: `__name:=...`, `__log:=...`."""
    for argument in arguments:
        if ":=" not in argument:
            raise InputError("not an argument", file=f"{name} run", value=argument, expected="name:=value at most")


def run_session(todo: SessionPlan, session: Iterable[Result], *, json: bool) -> None:
    """Run a session's trials, say how each ended and show the scores."""
    from dubins_traffic.cli.tables import show
    from dubins_traffic.record.sink import FAULTS

    results: list[Result] = []
    try:
        with faults.interruptible(lambda: f"interrupted after {len(results)} trials"):
            for result in session:
                results.append(result)
                ending = f"{result.ending.end}: {result.ending.detail}".rstrip(": ")
                faults.tell(f"trial {result.instance.trial}: {ending}")
    finally:
        if results:
            show(todo.conclude(results), json=json)
    if any(result.ending.end in FAULTS for result in results):
        raise typer.Exit(faults.FAILED)
