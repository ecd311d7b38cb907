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
    "convert out/trial-0000.mcap -o trial.bag",
)
CONTAINERS = (".json", ".rnd", ".txt")


def convert(
    file: Annotated[
        str, typer.Argument(metavar="FILE", help="A road network, a record or a bag.", show_default=False)
    ],
    output: Annotated[
        str, typer.Option("--output", "-o", metavar="FILE", help="What to write; its suffix says as what.")
    ],
) -> None:
    """Convert a road network (`.json` to `.rnd` or `.txt`, and back) or a record (to `.csv`, `.parquet` or `.bag`).

    A ROS 1 bag becomes a record (`.mcap`); beside a bag stands the trial data of 2016, `.trial.json`.
    """
    from dubins_traffic.campaign.bag_reader import bag_to_record, is_bag
    from dubins_traffic.campaign.bags import write_bag
    from dubins_traffic.campaign.sources import load
    from dubins_traffic.record.export import export
    from dubins_traffic.record.reader import Record
    from dubins_traffic.roads.network import RoadNetwork

    if is_bag(file):
        if Path(output).suffix.lower() != ".mcap":
            raise InputError(
                "not a record", file=output, value=Path(output).suffix, expected="the suffix .mcap"
            )
        bag_to_record(file, output, overwrite=True)
        return
    found = load(file)
    if isinstance(found, Record) and Path(output).suffix.lower() == ".bag":
        options.tell(str(write_bag(found, output)))
    elif isinstance(found, Record):
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
