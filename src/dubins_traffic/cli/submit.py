"""`dubins-traffic submit`, `status`, `logs` and `cancel`: a submission and the service it is handed in to."""

from __future__ import annotations

import json as json_text
from pathlib import Path
from typing import Annotated, Any

import typer

from dubins_traffic.cli import faults, options

EXAMPLES = options.examples(
    "submit my_entry --to https://compete.example.org/c/spring/practice --wait",
    "submit controller.py --to https://compete.example.org/c/spring/test --token-file token",
)
STATUS_EXAMPLES = options.examples("status https://compete.example.org/s/7")
LOGS_EXAMPLES = options.examples("logs https://compete.example.org/s/7")
CANCEL_EXAMPLES = options.examples("cancel https://compete.example.org/s/7")

Address = Annotated[str, typer.Argument(metavar="URL", help="Address of a submission's page.", show_default=False)]
TokenFile = Annotated[
    str | None,
    typer.Option(
        "--token-file",
        metavar="FILE",
        help="Your token, from the page of your team.",
        show_default="DUBINS_TRAFFIC_TOKEN of the environment",
    ),
]


def submit(
    path: Annotated[str, typer.Argument(metavar="PATH", help="As for [b]evaluate[/b].", show_default=False)],
    to: Annotated[str, typer.Option("--to", metavar="URL", help="Address of a phase's page.", show_default=False)],
    token_file: TokenFile = None,
    wait: Annotated[bool, typer.Option("--wait", help="Wait until it has ended.")] = False,
    json: options.Json = False,
) -> None:
    """Hand in a submission; the same again is the same submission, and costs nothing."""
    from dubins_traffic.service import client
    from dubins_traffic.service.client import token_from

    token = token_from(token_file)
    url, told = client.submit(to, Path(path), token)
    options.tell(url)
    _show(client.wait(url, token) if wait else told, json=json)


def status(url: Address, token_file: TokenFile = None, json: options.Json = False) -> None:
    """Say where a submission is: its state and why, its place in the queue, its scores as far as they may be seen."""
    from dubins_traffic.service import client
    from dubins_traffic.service.client import token_from

    _show(client.status(url, token_from(token_file)), json=json)


def logs(url: Address, token_file: TokenFile = None, json: options.Json = False) -> None:
    """Print what a submission has printed, as far as it may be seen."""
    from dubins_traffic.errors import shown
    from dubins_traffic.service import client
    from dubins_traffic.service.client import token_from

    told = client.logs(url, token_from(token_file))
    if json:
        print(json_text.dumps(told, indent=2))
        return
    for entry in told.get("trials", [{"number": None, "log": told.get("log", "")}]):
        if entry["number"] is not None:
            print(f"trial {entry['number']}")
        for line in str(entry["log"]).splitlines():
            print(f"  {shown(line)}")


def cancel(url: Address, token_file: TokenFile = None, json: options.Json = False) -> None:
    """Cancel a submission that has not ended."""
    from dubins_traffic.service import client
    from dubins_traffic.service.client import token_from

    _show(client.cancel(url, token_from(token_file)), json=json)


def _show(told: dict[str, Any], *, json: bool) -> None:
    """Print what may be seen of a submission; exit status 1 if it ended by a fault or was cancelled."""
    from dubins_traffic.errors import shown

    if json:
        print(json_text.dumps(told, indent=2))
    else:
        place = f", place {told['place']} in the queue" if told.get("place") else ""
        print(shown(f"{told['state']}{place}: {told['reason']}".rstrip(": ")))
        if told.get("owner"):
            print(f"fault of the {told['owner']}")
        summary: dict[str, float] = told.get("summary") or {}
        for name, value in summary.items():
            print(f"{name}: {value:.4g}")
    if told["state"] in ("rejected", "failed", "cancelled"):
        raise typer.Exit(faults.FAILED)
