"""`dubins-traffic check-controller`."""

from __future__ import annotations

import json as json_text
import os
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

from dubins_traffic.cli import faults, options
from dubins_traffic.errors import InputError

if TYPE_CHECKING:
    from dubins_traffic.checkup.checkup import Checkup

EXAMPLES = options.examples(
    "check-controller lanes",
    "check-controller my_controller.py:MyController --json",
    "check-controller theirs.py:Driver --sandbox",
    "check-controller ./my_controller --over lcm",
    'check-controller "rosrun my_package my_node" --over ros1',
    "check-controller rules --robustness",
)


class Over(StrEnum):
    """Transports over which a program can be checked."""

    ROS1 = "ros1"
    LCM = "lcm"
    ROS2 = "ros2"


def check_controller(
    controller: Annotated[
        str,
        typer.Argument(
            metavar="C",
            help="A built-in name, module:Class or path/to/file.py:Class; with --over a command line.",
            show_default=False,
            autocompletion=options.controllers,
        ),
    ],
    over: Annotated[
        Over | None,
        typer.Option("--over", help="C is a program that drives over this, in lockstep.", show_default="none"),
    ] = None,
    sandbox: options.Sandbox = False,
    limits: options.Limits = "",
    trust: options.Trust = False,
    robust: Annotated[
        bool,
        typer.Option(
            "--robustness",
            help="Instead: how it drives with commands that come late or get lost, and noisy poses.",
        ),
    ] = False,
    json: options.Json = False,
) -> None:
    """Run a controller through a short course, twice, and say what a competition would say of it.

    Does it start, survive odd instances, answer in time, send finite commands within bounds, do the same again, and
    end cleanly?
    """
    from dubins_traffic.checkup.checkup import check_controller as check
    from dubins_traffic.controllers.registry import dressed

    boxes = options.boxes(sandbox, limits, trust)
    for option, given in (("--sandbox", boxes is not None), ("--robustness", robust)):
        if given and over is not None:
            raise InputError("drives over a transport", file=option, value=over.value, expected="no --over")
    if robust:
        _tabulate(dressed(controller, sandbox=boxes), json=json)
        return
    report = check(dressed(controller, sandbox=boxes), None if over is None else over.value)
    if json:
        print(json_text.dumps(report.to_json(), indent=2))
    else:
        _show(report)
    if not report.passed:
        raise typer.Exit(faults.FAILED)


def _tabulate(controller: str, *, json: bool) -> None:
    """Print how the controller drives with disturbances: a table for each share of lost commands."""
    from rich.console import Console
    from rich.table import Table

    from dubins_traffic.checkup.robustness import DELAYS, LOSSES, NOISES, robustness
    from dubins_traffic.cli.progress import progress

    with progress() as tell:
        measured = robustness(
            controller,
            workers=os.cpu_count() or 1,
            delays=DELAYS,
            noises=NOISES,
            losses=LOSSES,
            progress=tell,
        )
    if json:
        print(json_text.dumps(measured.to_json(), indent=2))
        return
    console = Console(highlight=False)
    console.print("Clean trials (counted rounds), by the noise of the poses that it sees:")
    for loss in LOSSES:
        table = Table(title=f"{loss:.0%} of commands lost")
        table.add_column("late by")
        for noise in NOISES:
            table.add_column(f"{noise * 1e3:g} mm", justify="right")
        for delay in DELAYS:
            cells = [measured.cell(delay, noise, loss) for noise in NOISES]
            texts = [f"{cell.clean}/{cell.trials} ({cell.counted_rounds})" for cell in cells]
            table.add_row(f"{delay} tick" + "s" * (delay != 1), *texts)
        console.print(table)


def _show(checkup: Checkup) -> None:
    """Print findings and the histogram of latencies for people."""
    from rich.console import Console

    console = Console(highlight=False, soft_wrap=True)
    for finding in checkup.findings:
        mark = "ok    " if finding.passed else "FAILED"
        console.print(f"{mark} {finding.check}: {finding.detail}", markup=False)
    if not checkup.latency_s:
        return
    median, p99, longest = (checkup.latency_s[name] * 1e3 for name in ("median", "p99", "max"))
    console.print(f"\nanswers after {median:.3g} ms, 99% of them within {p99:.3g} ms, at most {longest:.3g} ms")
    most = max(count for _, count in checkup.histogram)
    for edge, count in checkup.histogram:
        label = "longer" if edge is None else f"<= {edge * 1e3:.3g} ms"
        bar = "#" * (40 * count // most)
        console.print(f"  {label:>10} {count:6} {bar}", markup=False)
