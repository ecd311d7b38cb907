"""`dubins-traffic list`."""

from __future__ import annotations

import json as json_text
import textwrap
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dubins_traffic.cli import options

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dubins_traffic.cli.catalogue import Entry, Parameter

EXAMPLES = options.examples(
    "list agents", "list rules", "list configurations --json", "list controllers", "list metrics"
)
WIDTH = 100
"""Columns of what is listed."""


class Subject(StrEnum):
    """The catalogues that `list` prints."""

    AGENTS = "agents"
    CAR_MODELS = "car-models"
    CONFIGURATIONS = "configurations"
    CONTROLLERS = "controllers"
    MAP_FORMATS = "map-formats"
    METRICS = "metrics"
    RULES = "rules"
    SIMULATORS = "simulators"


def listing(
    subject: Annotated[Subject, typer.Argument(help="What to list.", show_default=False)],
    json: Annotated[bool, typer.Option("--json", help="Print JSON for machines.")] = False,
) -> None:
    """List what there is, with what each does, its parameters and their defaults."""
    from dubins_traffic.cli import catalogue

    if subject is Subject.RULES:
        rules = catalogue.rules()
        if json:
            _print_json(subject, catalogue.Entry("rules", "", rules).to_json()["parameters"])
        else:
            _print_parameters(rules, "")
        return
    entries: Sequence[Entry] = getattr(catalogue, subject.value.replace("-", "_"))()
    if json:
        _print_json(subject, [entry.to_json() for entry in entries])
        return
    width = max(len(entry.name) for entry in entries)
    for entry in entries:
        print(f"{entry.name:{width}}  {entry.line}")
        _print_parameters(entry.parameters, "    ")
        for remark in entry.remarks:
            print(f"    ({remark})")


def _print_json(subject: Subject, listed: list[Any]) -> None:
    print(json_text.dumps({subject.value: listed}, indent=2))


def _print_parameters(parameters: Sequence[Parameter], indent: str) -> None:
    """Print a line for each parameter: name, default, meaning."""
    if not parameters:
        return
    first = max(len(parameter.name) for parameter in parameters)
    second = max(len(parameter.shown) for parameter in parameters)
    for parameter in parameters:
        head = f"{indent}{parameter.name:{first}}  {parameter.shown:{second}}  "
        lines = textwrap.wrap(parameter.meaning, max(40, WIDTH - len(head))) or [""]
        print((head + lines[0]).rstrip())
        for line in lines[1:]:
            print(" " * len(head) + line)
