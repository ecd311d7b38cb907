"""A session over the standard streams of programs that it starts."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator

from dubins_traffic.errors import InputError
from dubins_traffic.runs.single import Result
from dubins_traffic.sandbox.available import available_layers
from dubins_traffic.sandbox.limits import Limits
from dubins_traffic.sandbox.process import Processes
from dubins_traffic.sandbox.submission import program_of
from dubins_traffic.sessions.plan import Pace, SessionPlan
from dubins_traffic.transports.stdio import Child, Piped, Stdio


def run_over_stdio(
    session_plan: SessionPlan, pace: Pace, *, program: str | None = None, sandbox: bool = False
) -> Iterator[Result]:
    """Run the trials of `session_plan` and yield their results; leave nothing behind however it ends.

    Parameters
    ----------
    program : str
        The command line that is started for each remote car in each trial; in a box what `submission.program_of` takes.
    sandbox : bool
        Whether it runs in a box, with the default limits on memory, processes and files; `pace` limits its time.

    Raises
    ------
    InputError
        If there is no such program, no box can be made, or an instance can't be drawn.
    """
    if not program:
        raise InputError("missing", file="--program", expected="a command line to start")
    transport = Stdio(_boxed(program) if sandbox else _child(program))
    yield from session_plan.over(transport, pace, at=lambda: f"the standard streams of {program}")


def _child(program: str) -> Callable[[str], Piped]:
    words = shlex.split(program)
    return lambda _car: Child(words)


def _boxed(program: str) -> Callable[[str], Piped]:
    layers = available_layers()
    layers.require()
    inside = program_of(program)
    return lambda _car: Processes(inside, Limits(), layers, prints=True)
