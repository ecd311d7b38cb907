"""`dubins-traffic network`."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

from dubins_traffic.cli import options

EXAMPLES = options.examples(
    "network --grid 3 4",
    "network --intersections 20 --segments 30 --seed 7 -o town.json",
    "network --intersections 9 --segments 11 --format text",
)


class Format(StrEnum):
    """Containers of a road network."""

    JSON = "json"
    TEXT = "text"


def network(
    intersections: Annotated[
        int | None,
        typer.Option("--intersections", metavar="N", help="Draw a random network of N intersections"),
    ] = None,
    segments: Annotated[
        int | None,
        typer.Option("--segments", metavar="M", help="and M segments, N-1 up to floor(2N - 2 sqrt N)."),
    ] = None,
    grid: Annotated[
        tuple[int, int] | None,
        typer.Option("--grid", metavar="ROWS COLS", help="The complete grid.", show_default="3 4"),
    ] = None,
    seed: options.Seed = 0,
    format: Annotated[Format, typer.Option("--format", help="Container of the network.")] = Format.JSON,  # noqa: A002
    output: options.Output = None,
) -> None:
    """Print a road network: a grid, or one drawn at random."""
    from dubins_traffic.errors import InputError
    from dubins_traffic.roads.generate import generate
    from dubins_traffic.roads.network import RoadNetwork

    if grid is not None and (intersections is not None or segments is not None):
        raise InputError("two networks at once", file="--grid", expected="either --grid or --intersections")
