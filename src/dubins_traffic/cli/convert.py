"""`dubins-traffic convert`."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from dubins_traffic.cli import maps, options
from dubins_traffic.errors import InputError

EXAMPLES = options.examples(
    "convert town.json -o town.rnd",
    "convert town.json -o town.net.xml",
    "convert town.net.xml -o town.json --losses losses.png",
    "convert town.json -o town.sdf --sdf 1.9",
    "convert corner.grid -o town.json --map-format my_format.py:GridMap",
    "convert out/trial-0000.mcap -o trial.csv",
    "convert out/trial-0000.mcap -o trial.parquet",
    "convert out/trial-0000.mcap -o trial.bag",
    "convert out/trial-0000.mcap -o trial",
)
WORLD = ".sdf"


class Sdf(StrEnum):
    """Versions of SDF."""

    CLASSIC = "1.6"
    NEW = "1.9"


FileArgument = Annotated[
    str, typer.Argument(metavar="FILE", help="A road network, a record, a bag or a log.", show_default=False)
]
OutputOption = Annotated[
    str, typer.Option("--output", "-o", metavar="FILE", help="What to write; its suffix says as what.")
]
SdfOption = Annotated[
    Sdf,
    typer.Option("--sdf", help="Version of a world for Gazebo: 1.6 for 11 and older, 1.9 for newer ones."),
]
MapFormatOption = Annotated[
    str | None,
    typer.Option(
        "--map-format",
        metavar="F",
        help="A further map format, module:Class or path/to/file.py:Class, to read FILE or write the output.",
    ),
]


def convert(
    file: FileArgument,
    output: OutputOption,
    sdf: SdfOption = Sdf.CLASSIC,
    map_format: MapFormatOption = None,
    losses: maps.LossesOption = None,
    overwrite: options.Replace = False,
) -> None:
    """Convert a road network (its suffix says to which map format) or a record (to `.csv`, `.parquet` or a bag).

    Of the map of another program only what a network can hold is converted, and what was lost is told.

    A road network also becomes a world for Gazebo (`.sdf`); an instance or a record one with its obstacles and cars.
    A record becomes a bag of ROS 1 (`.bag`) or of ROS 2, a folder, if the output has no suffix.

    A bag, or a log of lcm-logger, becomes a record (`.mcap`), each further trial of it another one (`-1.mcap`,
    ...); beside a bag of ROS 1 stands the trial data of 2016, `.trial.json`.
    """
    from dubins_traffic.files import is_stream
    from dubins_traffic.gazebo.world import Version, write_sdf
    from dubins_traffic.interchange.bags import is_bag, write_bag
    from dubins_traffic.interchange.export import export
    from dubins_traffic.interchange.lcm_log import is_log
    from dubins_traffic.interchange.ros2_bags import write_ros2_bag
    from dubins_traffic.problem.instance import Instance
    from dubins_traffic.record.reader import Record
    from dubins_traffic.roads.formats import registry as formats
    from dubins_traffic.roads.network import RoadNetwork
    from dubins_traffic.runs.sources import load

    if not is_stream(file) and (is_bag(file) or is_log(file)):
        _to_records(file, output, overwrite=overwrite)
        return
    form = None if map_format is None else formats.load(map_format)
    if not Path(output).is_dir():
        options.require(output, "an output", ("",), overwrite=overwrite, apart_from=[file])
    with maps.telling(losses, file, output, overwrite=overwrite):
        document = load(file, map_format=form)
    network = document if isinstance(document, RoadNetwork) else None
    maps.require_outputs(network, losses, file, output, overwrite=overwrite)
    suffix = Path(output).suffix.lower()
    if suffix == WORLD and isinstance(document, RoadNetwork | Instance | Record):
        what = document.instance if isinstance(document, Record) else document
        write_sdf(what, output, Version(sdf.value), overwrite=overwrite)
    elif isinstance(document, Record) and suffix == ".bag":
        options.tell(output, str(write_bag(document, output, overwrite=overwrite)))
        return
    elif isinstance(document, Record) and suffix == "":
        write_ros2_bag(document, output, overwrite=overwrite)
    elif isinstance(document, Record):
        export(document, output, overwrite=overwrite)
    elif isinstance(document, RoadNetwork):
        if formats.of_suffix(output, form) is None:
            expected = f"a suffix of {', '.join((*formats.suffixes(form), WORLD))}"
            raise InputError(
                "not a container of road networks", file=output, value=Path(output).suffix, expected=expected
            )
        document.write(output, form, overwrite=overwrite)
        maps.report(document, losses, overwrite=overwrite)
    else:
        raise InputError("can't be converted", file=file, expected="a road network or a record")
    options.tell(output)


def _to_records(file: str, output: str, *, overwrite: bool) -> None:
    """Write the trials of a bag or log as records."""
    from dubins_traffic.interchange.bags import bag_to_records, is_bag
    from dubins_traffic.interchange.lcm_log import log_to_records
    from dubins_traffic.record.writer import SUFFIX

    options.require(output, "a record", (SUFFIX,), overwrite=overwrite, apart_from=[file])
    records = (bag_to_records if is_bag(file) else log_to_records)(file, output, overwrite=overwrite)
    count = [f"{len(records)} trials, {len(records)} records:"] if len(records) > 1 else []
    options.tell(*count, *map(str, records))
