"""`dubins-traffic lines`."""

from __future__ import annotations

from typing import Annotated

import typer

from dubins_traffic.cli import options, session

app = typer.Typer(help="Trials over JSON lines on a socket of this machine.", no_args_is_help=True)
EXAMPLES = options.examples(
    "lines run demo --lockstep --port 7411",
    "lines run my-trials.json --trials 3 --records out",
    "lines run demo --remote agent0 --controller lanes --lockstep",
)


@app.command("run", epilog=EXAMPLES)
@session.shared
def run(
    chosen: session.SessionOptions,
    port: Annotated[
        int,
        typer.Option("--port", metavar="PORT", min=0, max=65535, help="Where to listen; 0: any free one."),
    ] = 0,
) -> None:
    """Run trials whose ego, or some of whose e-agents, are driven over a socket. Ctrl-C keeps all finished trials."""
    from dubins_traffic.sessions.lines import run_over_lines

    todo = chosen.session_plan()
    session.run_session(todo, run_over_lines(todo, chosen.pace(), port=port), json=chosen.json)
