"""`dubins-traffic ros1 messages` and `lcm messages`: what other programs are built with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dubins_traffic.cli import options

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
