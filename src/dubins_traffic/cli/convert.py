"""`dubins-traffic convert`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dubins_traffic.cli import options
from dubins_traffic.errors import InputError

EXAMPLES = options.examples(
    "convert town.json -o town.rnd",
    "convert out/trial-0000.mcap -o trial.csv",
    "convert out/trial-0000.mcap -o trial.parquet",
)
CONTAINERS = (".json", ".rnd", ".txt")


def convert(
    file: Annotated[
        str, typer.Argument(metavar="FILE", help="A road network or a record.", show_default=False)
    ],
    output: Annotated[
        str, typer.Option("--output", "-o", metavar="FILE", help="What to write; its suffix says as what.")
    ],
) -> None:
    """Convert a road network (`.json` to `.rnd` or `.txt`, and back) or a record (to `.csv` or `.parquet`)."""
    from dubins_traffic.campaign.sources import load
    from dubins_traffic.record.export import export
    from dubins_traffic.record.reader import Record
    from dubins_traffic.roads.network import RoadNetwork

    found = load(file)
    if isinstance(found, Record):
        export(found, output)
    elif isinstance(found, RoadNetwork):
        if Path(output).suffix.lower() not in CONTAINERS:
            expected = f"a suffix of {', '.join(CONTAINERS)}"
            raise InputError(
                "not a container of road networks", file=output, value=Path(output).suffix, expected=expected
            )
        found.write(output)
    else:
        raise InputError("can't be converted", file=file, expected="a road network or a record")
