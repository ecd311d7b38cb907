"""Other programs open what we write, and find the same junctions, lanes and lengths in it."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dubins_traffic.roads.generate import generate
from dubins_traffic.roads.network import RoadNetwork
from tests.foreign_maps import BENT
from tests.roadnets import winding
from tests.tools import interpreter_with, sumo_program

pytestmark = pytest.mark.tools

HERE = Path(__file__).parent
NETWORKS = {
    "grid": RoadNetwork.grid(3, 4, 3.25, (1.5, -2.0, 0.7)),
    "drawn": generate(9, 12, 3),
    "bent": RoadNetwork.from_document(BENT),
    "swerving": generate(16, 22, 7, bent=0.7),
    "winding": winding(3, most=5),
}
"""Roads of the last two have up to six corners, which lie otherwise seen from the other end."""


@pytest.fixture(params=NETWORKS)
def network(request: pytest.FixtureRequest) -> RoadNetwork:
    return NETWORKS[request.param]


def facts(tool: str, file: Path) -> dict[str, Any]:
    """Return what a tool's own reader finds in a file."""
    command = [interpreter_with(tool), str(HERE / f"{tool}_facts.py"), str(file)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def lanes_of(network: RoadNetwork) -> list[list[float]]:
    """Return for each lane where it begins and ends, and its length."""
    rows: list[list[float]] = []
    for lane in range(network.lanes):
        first, last = network.lane_ends(lane)
        rows.append([*network.points[first], *network.points[last], float(network.lengths[lane >> 1])])
    return rows


def turns_of(network: RoadNetwork) -> int:
    return sum(len(network.successors(lane)) for lane in range(network.lanes))


def crossings_of(network: RoadNetwork) -> list[list[float]]:
    return network.points[network.degrees >= 3].tolist()


def close(found: list[list[float]], wanted: list[list[float]], metres: float) -> bool:
    """Whether rows are the same in any order, within so many metres."""
    if len(found) != len(wanted):
        return False
    one, other = np.array(found), np.array(wanted)
    gaps = np.abs(one[:, None, :] - other[None]).max(axis=2)
    return bool((gaps.min(axis=0) <= metres).all() and (gaps.min(axis=1) <= metres).all())


def test_sumo_finds_the_same(network: RoadNetwork, tmp_path: Path) -> None:
    file = tmp_path / "town.net.xml"
    network.write(file)
    found = facts("sumo", file)
    degrees = network.degrees >= 3
    wanted = [[*place, float(stop)] for place, stop in zip(network.points, degrees, strict=True)]
    assert close(found["junctions"], wanted, 1e-9)
    assert close(found["lanes"], lanes_of(network), 1e-9)
    assert found["turns"] == turns_of(network)
    lines = np.concatenate([network.lane_curve(lane, 0.0) for lane in range(network.lanes)])
    assert found["box"] == pytest.approx([*lines.min(axis=0), *lines.max(axis=0)], abs=1e-2)


def test_sumo_runs_and_netconvert_reads(network: RoadNetwork, tmp_path: Path) -> None:
    network.write(tmp_path / "town.net.xml")
    network.write(tmp_path / "town.xodr")
    for command in (
        ["sumo", "-n", "town.net.xml", "--end", "10"],
        ["netconvert", "-s", "town.net.xml", "-o", "again.net.xml"],
        ["netconvert", "--opendrive-files", "town.xodr", "-o", "drive.net.xml"],
    ):
        whole = [sumo_program(command[0]), *command[1:]]
        done = subprocess.run(whole, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=600)
        assert done.returncode == 0, done.stderr
        assert "rror" not in done.stderr, done.stderr


def test_commonroad_finds_the_same(network: RoadNetwork, tmp_path: Path) -> None:
    file = tmp_path / "town.xml"
    network.write(file)
    found = facts("commonroad", file)
    assert close(found["junctions"], crossings_of(network), 1e-9)
    assert found["signs"] == ["TrafficSignIDUsa.STOP_4_WAY"] * len(crossings_of(network))
    assert close(found["lanes"], lanes_of(network), 2e-3)
    assert found["turns"] == turns_of(network)


def test_lanelet2_finds_the_same(network: RoadNetwork, tmp_path: Path) -> None:
    file = tmp_path / "town.osm"
    network.write(file)
    found = facts("lanelet2", file)
    assert found["errors"] == []
    assert close(found["junctions"], crossings_of(network), 1e-6)
    assert close(found["lanes"], lanes_of(network), 2e-3)
