"""`dubins-traffic list`."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import Annotated

import typer

from dubins_traffic.cli import options

EXAMPLES = options.examples("list agents", "list controllers")


class Subject(StrEnum):
    """What there are several of."""

    AGENTS = "agents"
    CONTROLLERS = "controllers"
    SIMULATORS = "simulators"


def listing(
    subject: Annotated[Subject, typer.Argument(help="What to list.", show_default=False)],
) -> None:
    """List the e-agents, controllers or simulators that there are, with what each does."""
    lines = _names(subject)
    width = max(map(len, lines))
    for name, line in lines.items():
        print(f"{name:{width}}  {line}")


def _names(subject: Subject) -> Mapping[str, str]:
    match subject:
        case Subject.AGENTS:
            from dubins_traffic.agents.registry import names
        case Subject.CONTROLLERS:
            from dubins_traffic.controllers.registry import names
        case Subject.SIMULATORS:
            from dubins_traffic.simulators.registry import names
    return names()
