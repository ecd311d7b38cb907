"""The two largest towns with one lane in each direction that come with SUMO, as road networks."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from dubins_traffic.errors import InputError
from dubins_traffic.roads.clearance import clearance_faults
from dubins_traffic.roads.formats.opendrive import OpenDrive
from dubins_traffic.roads.formats.sumo import SumoNet
from dubins_traffic.roads.network import RoadNetwork
from tests.room import lacking
from tests.tools import interpreter_with

TOWNS = {"DRT/osm": 16_000.0, "bs3d/bs": 5_600.0}
"""Files below `tools/game`, and the least metres with one lane in each direction in them."""
LEAST = 0.85


def folder() -> Path:
    """Return where SUMO's own towns are."""
    environment = Path(interpreter_with("sumo")).parents[1]
    return next(environment.glob("lib/python*/site-packages/sumo/tools"))


def test_these_are_the_two_largest() -> None:
    lengths: dict[str, float] = {}
    for file in sorted(folder().glob("**/*.net.xml")):
        try:
            found = SumoNet().read_map(file.read_text())
        except InputError:
            continue
        name = file.relative_to(folder() / "game").as_posix() if "game" in file.parts else file.name
        lengths[name.removesuffix(".net.xml")] = sum(road.length for road in found.roads if road.is_plain)
    largest = sorted(lengths, key=lambda name: lengths[name])[-2:]
    assert set(largest) == set(TOWNS)


@pytest.mark.parametrize("town", TOWNS)
def test_a_town_is_kept(town: str) -> None:
    document, losses = SumoNet().reduced((folder() / "game" / f"{town}.net.xml").read_text())
    network = RoadNetwork.from_document(document)
    assert losses.tolerance == 0.1
    assert losses.plain_length >= TOWNS[town]
    assert losses.kept_share >= LEAST
    assert not network.is_straight
    assert clearance_faults(network, 1.0, 0.177, 0.3) == []
    assert lacking(network) == []


def test_the_same_town_by_way_of_opendrive(tmp_path: Path) -> None:
    programs = Path(interpreter_with("sumo")).parent
    source = folder() / "game" / "bs3d" / "bs.net.xml"
    command = [
        str(programs / "netconvert"),
        "-s",
        str(source),
        "--opendrive-output",
        str(tmp_path / "bs.xodr"),
    ]
    subprocess.run(command, check=True, capture_output=True, timeout=300)
    direct = SumoNet().reduced(source.read_text())
    document, losses = OpenDrive().reduced((tmp_path / "bs.xodr").read_text())
    assert losses.kept_share >= LEAST
    assert len(document["segments"]) == len(direct.document["segments"])
