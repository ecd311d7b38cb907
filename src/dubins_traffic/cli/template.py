"""`dubins-traffic template`, `ros1 messages` and `lcm messages`: what programs of others are made from."""

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


ROS1_EXAMPLES = options.examples("ros1 messages build/ros --cpp")
LCM_EXAMPLES = options.examples("lcm messages -o dubins_traffic_lcm.lcm")


def ros1(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Where to write, made if missing.", show_default=False)],
    cpp: Annotated[bool, typer.Option("--cpp", help="C++ headers instead of Python packages.")] = False,
    overwrite: options.Replace = False,
) -> None:
    """Write the message packages that Debian lacks: gazebo_msgs, dubins_traffic_msgs, integrator_chains_msgs."""
    from dubins_traffic.transports.ros1.messages import write_cpp, write_python

    (write_cpp if cpp else write_python)(folder, overwrite=overwrite)
    options.tell(str(folder))


def lcm(output: options.Output = None, overwrite: options.Replace = False) -> None:
    """Print the definitions of the messages, from which lcm-gen makes code for C, C++, Java, Lua, Go, ..."""
    from importlib.resources import files

    options.require(output, "definitions", (".lcm",), overwrite=overwrite, standard=True)
    definitions = files("dubins_traffic.transports.lcm") / "dubins_traffic_lcm.lcm"
    options.write(definitions.read_text(encoding="utf-8"), output)
