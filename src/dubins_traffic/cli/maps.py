"""Maps of other programs on the command line: reading them, and telling what was lost."""

from __future__ import annotations

import json
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dubins_traffic.cli import options
from dubins_traffic.errors import InputError

if TYPE_CHECKING:
    from dubins_traffic.maps.losses import Losses
    from dubins_traffic.maps.part import Part
    from dubins_traffic.roads.network import RoadNetwork

LossesOption = Annotated[
    list[str] | None,
    typer.Option(
        "--losses",
        metavar="FILE",
        help="Write what was lost of a map of another program: `.json`, or a picture; may be given several times.",
    ),
]


def imported(
    file: str,
    scale: float | None,
    w: float | None,
    tolerance: float,
    part: Part | None = None,
    pairs: float | None = None,
) -> RoadNetwork:
    """Return the network that a file holds, of whatever format; InputError if it holds none, or nothing can be held.

    Where a scale is given and `w` is not, that is half a lane of the map at the scale. A `part` of it must have a loop.
    One-way roads at most `pairs` metres apart become one road.
    """
    from dubins_traffic.files import read_text
    from dubins_traffic.maps.foreign import ForeignFormat
    from dubins_traffic.maps.part import require_loop
    from dubins_traffic.maps.settings import ImportSettings, W
    from dubins_traffic.roads.formats import registry as formats
    from dubins_traffic.roads.network import RoadNetwork

    text = read_text(file)
    form = formats.of_text(text)
    if not isinstance(form, ForeignFormat):
        require_no_map_options(file, scale, w, part, pairs)
        return RoadNetwork.from_text(text, file, form)
    settings = ImportSettings(
        w=W if w is None else w, scale=scale, tolerance=tolerance, pairs=0.0 if pairs is None else pairs
    )
    keeps_lanes = scale is not None and w is None
    document, losses = form.reduced(text, file, settings, own_lanes=keeps_lanes, part=part)
    network = RoadNetwork.from_document(document, file)
    if part is not None:
        require_loop(network, losses, part, file)
    network.known[formats.LOSSES] = losses
    return network


def part_asked(clip: str | None, around: tuple[str, float] | None) -> Part | None:
    """Return the part of a map that is asked for, None if all of it is; InputError if it is none, or two are."""
    from dubins_traffic.maps.part import CLIP, Around, Clip

    if clip is not None and around is not None:
        raise InputError("two parts at once", file=CLIP, value=clip, expected="--clip or --around, not both")
    if clip is not None:
        return Clip.read(clip)
    return None if around is None else Around(*around)


def require_no_map_options(
    source: str | None,
    scale: float | None,
    w: float | None,
    part: Part | None = None,
    pairs: float | None = None,
) -> None:
    """Refuse what only a map of another program allows where the network in `source` comes from none."""
    part_option = str(part).partition(" ")[0]
    for name, given in (("--scale", scale), ("--w", w), (part_option, part), ("--pairs", pairs)):
        if given is not None:
            raise InputError("nothing to reduce", file=name, value=source, expected="--from a map of another program")


@contextmanager
def telling(outputs: list[str] | None, *others: str | None, overwrite: bool) -> Generator[None]:
    """Tell what was lost, and write it to files, also where nothing of a map can be held, which is then refused.

    `others` are what is read, and what else is written.
    """
    from dubins_traffic.maps.losses import NothingHeldError

    try:
        yield
    except NothingHeldError as error:
        _require(outputs or [], *others, overwrite=overwrite)
        _tell(error.losses, outputs or [], overwrite=overwrite)
        raise


def require_outputs(
    network: RoadNetwork | None, outputs: list[str] | None, *others: str | None, overwrite: bool
) -> None:
    """Refuse files to which what was lost can't be written, before anything is: as `report` would.

    `others` are what is read, and what else is written.
    """
    if outputs and _losses(network) is None:
        raise InputError("nothing to tell", file="--losses", value=outputs[0], expected="a map of another program")
    _require(outputs or [], *others, overwrite=overwrite)


def _require(outputs: list[str], *others: str | None, overwrite: bool) -> None:
    if not outputs:
        return

    from dubins_traffic.problem.files import DOCUMENTS
    from dubins_traffic.viewer.figures import require_picture

    for number, output in enumerate(outputs):
        apart_from = [*others, *outputs[:number]]
        if _is_json(output):
            options.require(output, "losses", DOCUMENTS, overwrite=overwrite, apart_from=apart_from)
        else:
            require_picture(output, overwrite=overwrite, apart_from=apart_from)


def report(network: RoadNetwork | None, outputs: list[str] | None = None, *, overwrite: bool = False) -> None:
    """Tell on standard error what was lost of the map from which a network comes, and write it to files.

    Nothing is told of networks that come from no map of another program, and where there is none (None).
    """
    losses = _losses(network)
    if losses is not None:
        _tell(losses, outputs or [], overwrite=overwrite)


def _tell(losses: Losses, outputs: list[str], *, overwrite: bool) -> None:
    from dubins_traffic.files import write_text

    for line in losses.lines():
        print(line, file=sys.stderr)
    for output in outputs:
        if _is_json(output):
            write_text(output, json.dumps(losses.document(), indent=1) + "\n")
        else:
            from dubins_traffic.maps.loss_picture import write_losses

            write_losses(output, losses, overwrite=overwrite)
        options.tell(output)


def _losses(network: RoadNetwork | None) -> Losses | None:
    """Return what was lost of the map from which a network comes, None where it comes from none."""
    from dubins_traffic.maps.losses import Losses
    from dubins_traffic.roads.formats import registry as formats

    losses = None if network is None else network.known.get(formats.LOSSES)
    return losses if isinstance(losses, Losses) else None


def _is_json(output: str) -> bool:
    return Path(output).suffix.lower() == ".json"
