"""Maps of other programs on the command line: reading them, and telling what was lost."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dubins_traffic.cli import options
from dubins_traffic.errors import InputError

if TYPE_CHECKING:
    from dubins_traffic.roads.network import RoadNetwork

LossesOption = Annotated[
    list[str] | None,
    typer.Option(
        "--losses",
        metavar="FILE",
        help="Write what was lost of a map of another program: `.json`, or a picture; may be given several times.",
    ),
]


def imported(file: str, scale: float | None, w: float, tolerance: float) -> RoadNetwork:
    """Return the network that a file holds, of whatever format; InputError if it holds none, or nothing can be held."""
    from dubins_traffic.files import read_text
    from dubins_traffic.roads.formats import registry as formats
    from dubins_traffic.roads.formats.foreign import ForeignFormat
    from dubins_traffic.roads.maps.settings import ImportSettings
    from dubins_traffic.roads.network import RoadNetwork

    text = read_text(file)
    form = formats.of_text(text)
    if not isinstance(form, ForeignFormat):
        return RoadNetwork.from_text(text, file, form)
    settings = ImportSettings(w=w, scale=scale, tolerance=tolerance)
    document, losses = form.reduced(text, file, settings)
    network = RoadNetwork.from_document(document, file)
    network.known[formats.LOSSES] = losses
    return network


def report(network: RoadNetwork | None, outputs: list[str] | None = None) -> None:
    """Tell on standard error what was lost of the map from which a network comes, and write it to files.

    Nothing is told of networks that come from no map of another program, and where there is none (None).
    """
    from dubins_traffic.files import write_text
    from dubins_traffic.roads.formats import registry as formats
    from dubins_traffic.roads.maps.losses import Losses

    losses = None if network is None else network.known.get(formats.LOSSES)
    if not isinstance(losses, Losses):
        if outputs:
            raise InputError(
                "nothing to tell", file="--losses", value=outputs[0], expected="a map of another program"
            )
        return
    for line in losses.lines():
        print(line, file=sys.stderr)
    for output in outputs or []:
        if Path(output).suffix.lower() == ".json":
            write_text(output, json.dumps(losses.document(), indent=1) + "\n")
        else:
            from dubins_traffic.viewer.losses import write_losses

            write_losses(output, losses)
        options.tell(output)
