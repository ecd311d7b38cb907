"""`dubins-traffic lcm`."""

from __future__ import annotations

from typing import Annotated

import typer

from dubins_traffic.cli import options, session

app = typer.Typer(help="Trials over LCM, with typed messages by UDP multicast.", no_args_is_help=True)
EXAMPLES = options.examples(
    "lcm run demo --lockstep",
    "lcm run my-trials.json --trials 3 --records out --url udpm://239.255.76.67:7700?ttl=0",
    "lcm run demo --remote agent0 --controller lanes",
)


@app.command("run", epilog=EXAMPLES)
@session.shared
def run(
    chosen: session.SessionOptions,
    url: Annotated[
        str | None,
        typer.Option(
            "--url",
            metavar="URL",
            help="Where messages go.",
            show_default="$LCM_DEFAULT_URL, else multicast within this machine",
        ),
    ] = None,
    wait: Annotated[
        bool, typer.Option("--wait", help="Begin each trial when a program asks START, not at once.")
    ] = False,
) -> None:
    """Run trials whose ego, or some of whose e-agents, are driven over LCM. Ctrl-C keeps all finished trials."""
    from dubins_traffic.sessions.lcm import run_over_lcm

    todo = chosen.session_plan()
    session.run_session(todo, run_over_lcm(todo, chosen.pace(), url=url, wait=wait), json=chosen.json)


@app.command("messages", epilog=options.examples("lcm messages -o dubins_traffic_lcm.lcm"))
def messages(output: options.Output = None) -> None:
    """Print the definitions of the messages, from which lcm-gen makes code for C, C++, Java, Lua, Go, ..."""
    from importlib.resources import files

    definitions = files("dubins_traffic.transports.lcm") / "dubins_traffic_lcm.lcm"
    options.write(definitions.read_text(encoding="utf-8"), output)
