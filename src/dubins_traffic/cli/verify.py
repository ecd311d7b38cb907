"""`dubins-traffic verify`."""

from __future__ import annotations

import json as json_text
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dubins_traffic.cli import faults, options
from dubins_traffic.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from dubins_traffic.problem.instance import Instance
    from dubins_traffic.record.reader import Record
    from dubins_traffic.verification.verify import Scores

EXAMPLES = options.examples(
    "verify out/*.mcap",
    "verify out/trial-0000.mcap --instance instance.json",
    "verify out/*.mcap --configuration town --seed 7 --json",
)

RecordsArgument = Annotated[
    list[str], typer.Argument(metavar="RECORD...", help="Records, `*.mcap`.", show_default=False)
]
InstanceOption = Annotated[
    str | None, typer.Option("--instance", metavar="FILE", help="The instance that was to be run.")
]
ConfigurationOption = Annotated[
    str | None,
    typer.Option(
        "--configuration",
        metavar="CONFIG",
        help="What the instances were to be drawn from.",
        autocompletion=options.shipped,
    ),
]
SeedOption = Annotated[int, typer.Option("--seed", metavar="S", min=0, help="The seed of the configuration's trials.")]
TrialOption = Annotated[
    int | None,
    typer.Option("--trial", metavar="I", min=0, help="The trial's number.", show_default="as the record says"),
]
SimulatorOption = Annotated[
    str | None,
    typer.Option(
        "--simulator",
        metavar="S",
        help="What was to move the cars.",
        show_default="as the instance says",
        autocompletion=options.simulators,
    ),
]
ScoresOption = Annotated[
    str | None,
    typer.Option(
        "--scores",
        metavar="FILE",
        help="What `run --json` or `score --json` printed of the records.",
        show_default="scores.json beside a record, if it names it",
    ),
]


def verify(
    records: RecordsArgument,
    instance: InstanceOption = None,
    configuration: ConfigurationOption = None,
    rnd: options.Network = None,
    seed: SeedOption = 0,
    trial: TrialOption = None,
    simulator: SimulatorOption = None,
    scores: ScoresOption = None,
    json: options.Json = False,
) -> None:
    """Simulate recorded trials again, and say what in a record is not what happened.

    Trials of our simulator are run again from instance and recorded commands, and all is compared bit for bit. Exit
    status: 0 if all are verified, 1 if one differs, 2 if one can't be read.
    """
    from dubins_traffic.verification.verify import read_sheet

    expected = _expected(instance, configuration, rnd, seed, trial, simulator)
    printed = None if scores is None else read_sheet(scores)
    checked: list[dict[str, Any]] = []
    status = faults.OK
    for record in records:
        outcome = _outcome(record, expected, printed, quiet=json)
        checked.append(outcome)
        unread = "error" in outcome
        status = max(status, faults.WRONG_INPUT if unread else int(not outcome["verified"]))
    if json:
        print(json_text.dumps({"records": checked}, indent=2))
    if status != faults.OK:
        raise typer.Exit(status)


def _outcome(
    record: str, expected: Callable[[Record], Instance] | None, scores: Scores | None, *, quiet: bool
) -> dict[str, Any]:
    """Verify a record, print its line and return what JSON says of it."""
    from dubins_traffic.verification.verify import verify as verified

    try:
        result = verified(record, instance=expected, scores=scores)
    except InputError as error:
        faults.tell(str(error))
        return {"record": record, "verified": False, "error": str(error)}
    if not quiet:
        print(f"{record}: {result}")
    return {**result.to_json(), "record": record}


def _expected(
    instance: str | None,
    configuration: str | None,
    rnd: str | None,
    seed: int,
    trial: int | None,
    simulator: str | None,
) -> Callable[[Record], Instance] | None:
    """Return what tells of a record which instance was to be run; None if the options don't."""
    if instance is not None and configuration is not None:
        expected = "--instance or --configuration"
        raise InputError("two sources of the instance", file="--instance", value=instance, expected=expected)
    if instance is not None:
        from dubins_traffic.problem.document import load_instance

        given = load_instance(instance)
        given = given if simulator is None else replace(given, simulator=simulator)
        return lambda _record: given
    if configuration is None:
        for name, value in (("--rnd", rnd), ("--trial", trial), ("--simulator", simulator)):
            if value is not None:
                raise InputError("needs more", file=name, value=value, expected="--configuration as well")
        return None
    from dubins_traffic.problem.configuration import load_config
    from dubins_traffic.problem.draw import draw

    settings = load_config(configuration, rnd)
    settings = settings if simulator is None else settings.with_simulator(simulator)
    return lambda record: draw(settings, seed, record.instance.trial if trial is None else trial)
