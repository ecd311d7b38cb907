"""`dubins-traffic template`."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from dubins_traffic.cli import options

EXAMPLES = options.examples(
    "template python my_entry", "template cpp my_entry", "template ros2 workspace/src/traffic_nodes"
)


class Language(StrEnum):
    """What there is a template of."""

    PYTHON = "python"
    CPP = "cpp"
    ROS2 = "ros2"


def template(
    kind: Annotated[
        Language,
        typer.Argument(
            metavar="python|cpp|ros2",
            help="A submission in that language, or nodes in both and a launch file.",
            show_default=False,
        ),
    ],
    folder: Annotated[str, typer.Argument(metavar="DIR", help="A folder to make.", show_default=False)],
) -> None:
    """Make a folder to begin from: a submission that can be evaluated as it is, or a package of nodes of ROS 2."""
    from dubins_traffic.competition.templates import write_template

    for path in write_template(kind.value, Path(folder)):
        options.tell(str(path))
