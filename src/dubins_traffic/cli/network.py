"""`dubins-traffic network`."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

from dubins_traffic.cli import maps, options
from dubins_traffic.errors import InputError

EXAMPLES = options.examples(
    "network --grid 3 4",
    "network --intersections 20 --segments 30 --seed 7 -o town.json",
    "network --intersections 9 --segments 11 --format text",
    "network --from town.net.xml -o town.json --losses losses.png",
    "network --from town.net.xml --around J12 400 -o part.json",
)


class Format(StrEnum):
    """Containers of a road network."""

    JSON = "json"
    TEXT = "text"


SUFFIXES = {Format.JSON: (".json",), Format.TEXT: (".rnd", ".txt")}
"""How names of files with these containers end."""


IntersectionsOption = Annotated[
    int | None, typer.Option("--intersections", metavar="N", help="Draw a random network of N intersections")
]
SegmentsOption = Annotated[
    int | None,
    typer.Option("--segments", metavar="M", help="With --intersections: M segments, N-1 up to floor(2N - 2 sqrt N)."),
]
GridOption = Annotated[
    tuple[int, int] | None,
    typer.Option("--grid", metavar="ROWS COLS", help="The complete grid.", show_default="3 4"),
]
BentOption = Annotated[
    float,
    typer.Option(
        "--bent",
        metavar="SHARE",
        min=0.0,
        max=1.0,
        help="With --intersections: about so many of the segments bend, 0 to 1.",
    ),
]
SourceOption = Annotated[
    str | None,
    typer.Option("--from", metavar="FILE", help="The network that a map of another program holds."),
]
ScaleOption = Annotated[
    float | None,
    typer.Option("--scale", metavar="K", help="Metres of it for a metre of the map.", show_default="a lane is 2w wide"),
]
WidthOption = Annotated[
    float | None,
    typer.Option(
        "--w",
        metavar="W",
        help="Half the width of its lanes, metres.",
        show_default="0.3; with --scale half a lane of the map",
    ),
]
ToleranceOption = Annotated[
    float,
    typer.Option("--tolerance", metavar="D", help="How far a road may be from the map's, metres of the map."),
]

PairsOption = Annotated[
    float | None,
    typer.Option(
        "--pairs",
        metavar="D",
        help="Of a map, make one road of two one-way roads, at most D metres apart, one for each direction.",
    ),
]
ClipOption = Annotated[
    str | None,
    typer.Option(
        "--clip",
        metavar="X0,Y0,X1,Y1",
        help="Of a map, the roads wholly in this rectangle, metres of the map.",
    ),
]
AroundOption = Annotated[
    tuple[str, float] | None,
    typer.Option(
        "--around",
        metavar="JUNCTION RADIUS",
        help="Of a map, the roads wholly within so many metres of a junction.",
    ),
]


def network(
    intersections: IntersectionsOption = None,
    segments: SegmentsOption = None,
    grid: GridOption = None,
    bent: BentOption = 0.0,
    source: SourceOption = None,
    scale: ScaleOption = None,
    w: WidthOption = None,
    tolerance: ToleranceOption = 0.1,
    clip: ClipOption = None,
    around: AroundOption = None,
    pairs: PairsOption = None,
    losses: maps.LossesOption = None,
    seed: options.Seed = 0,
    format: Annotated[Format, typer.Option("--format", help="Container of the network.")] = Format.JSON,
    output: options.Output = None,
    overwrite: options.Replace = False,
) -> None:
    """Print a road network: a grid, one drawn at random, or what can be held of a map."""
    from dubins_traffic.files import packed
    from dubins_traffic.roads.generate import generate
    from dubins_traffic.roads.network import RoadNetwork

    suffixes = packed(*SUFFIXES[format])
    options.require(output, "a road network", suffixes, overwrite=overwrite, apart_from=[source], standard=True)
    part = maps.part_asked(clip, around)
    if source is None:
        maps.require_no_map_options(None, scale, w, part, pairs)
    if source is not None:
        if (intersections, segments, grid) != (None, None, None):
            raise InputError("two networks at once", file="--from", value=source, expected="nothing else beside it")
        with maps.telling(losses, source, output, overwrite=overwrite):
            made = maps.imported(source, scale, w, tolerance, part, pairs)
    elif intersections is None and segments is None:
        rows, columns = grid or (3, 4)
        made = RoadNetwork.grid(rows, columns)
    elif grid is not None:
        raise InputError(
            "two networks at once", file="--grid", value=grid, expected="--grid or --intersections, not both"
        )
    elif intersections is None or segments is None:
        missing = "--intersections" if intersections is None else "--segments"
        raise InputError("missing", file=missing, expected="both --intersections and --segments")
    else:
        made = generate(intersections, segments, seed, bent=bent)
    maps.require_outputs(made, losses, source, output, overwrite=overwrite)
    options.write(made.to_json() if format is Format.JSON else made.to_text(), output)
    maps.report(made, losses, overwrite=overwrite)
