"""SUMO's own programs on what we write: netconvert finds the same junctions and lanes, sumo drives on it."""

from __future__ import annotations

import subprocess
from pathlib import Path
from random import Random
from xml.etree import ElementTree

import numpy as np
import pytest

from dubins_traffic.maps.opendrive import OpenDrive
from dubins_traffic.maps.settings import ImportSettings
from dubins_traffic.roads.network import RoadNetwork
from tests.crosscheck.test_map_tools import NETWORKS, close, lanes_of
from tests.tools import sumo_program

pytestmark = pytest.mark.tools

SHORTEST_CHORD = "0.02"
"""Metres; netconvert makes polylines of arcs."""
MICROMETRE = 1.1e-6
"""The unit of netconvert's coordinates."""
CARS, EVERY_S = 150, 8
CAR = '<vType id="car" length="0.3" minGap="0.2" maxSpeed="1" accel="1" decel="2" sigma="0"/>'
"""A car of the size of ours; another sets out every few seconds."""


@pytest.fixture(params=NETWORKS)
def network(request: pytest.FixtureRequest) -> RoadNetwork:
    return NETWORKS[request.param]


def run(folder: Path, *command: str) -> None:
    """Run a program of SUMO in a folder."""
    whole = [sumo_program(command[0]), *command[1:]]
    done = subprocess.run(whole, cwd=folder, capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == 0, done.stderr
    assert "rror" not in done.stderr, done.stderr


def length(line: np.ndarray) -> float:
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


@pytest.mark.parametrize("suffix", ["net.xml", "xodr"])
def test_netconvert_finds_the_same(network: RoadNetwork, suffix: str, tmp_path: Path) -> None:
    network.write(tmp_path / f"town.{suffix}")
    options = ["--plain-output-prefix", "plain", "--precision", "12"]
    if suffix == "net.xml":
        command = ["-s", "town.net.xml"]
    else:
        command = ["--opendrive-files", "town.xodr", "--opendrive.curve-resolution", SHORTEST_CHORD]
    run(tmp_path, "netconvert", *command, *options)
    nodes = ElementTree.parse(tmp_path / "plain.nod.xml").getroot()
    # The net of netconvert begins at the origin; its offset says where that is.
    offset = nodes.find("location").get("netOffset").split(",")  # pyright: ignore[reportOptionalMemberAccess]
    moved = np.array([float(part) for part in offset])
    places = {
        node.get("id"): np.array([float(node.get("x", "nan")), float(node.get("y", "nan"))]) - moved
        for node in nodes.iter("node")
    }
    assert close([place.tolist() for place in places.values()], network.points.tolist(), MICROMETRE)
    rows: list[list[float]] = []
    for edge in ElementTree.parse(tmp_path / "plain.edg.xml").getroot().iter("edge"):
        assert edge.get("numLanes") == "1"
        ends = [places[edge.get(end)] for end in ("from", "to")]
        shape = [tuple(float(part) for part in each.split(",")) for each in edge.get("shape", "").split()]
        line = np.array(shape)[:, :2] - moved if shape else np.array(ends)
        rows.append([*ends[0], *ends[1], length(line)])
    assert close(rows, lanes_of(network), 5e-3)


def test_sumo_drives_on_it(network: RoadNetwork, tmp_path: Path) -> None:
    """A car goes over each pair of edges that follow each other at some junction of the first road."""
    network.write(tmp_path / "town.net.xml")
    pairs = [(lane, after) for lane in (0, 1) for after in network.successors(lane)]
    names = [f"{'-' if lane & 1 else ''}s{lane >> 1}" for lane in range(network.lanes)]
    routes = "".join(
        f'<vehicle id="{k}" depart="{300 * k}" departPos="0"><route edges="{names[a]} {names[b]}"/></vehicle>'
        for k, (a, b) in enumerate(pairs)
    )
    (tmp_path / "routes.rou.xml").write_text(f"<routes>{routes}</routes>")
    run(
        tmp_path, "sumo", "-n", "town.net.xml", "-r", "routes.rou.xml", "--tripinfo-output", "trips.xml",
        "--no-step-log", "--precision", "6",
    )  # fmt: skip
    trips = ElementTree.parse(tmp_path / "trips.xml").getroot().findall("tripinfo")
    found = {int(trip.get("id", "-1")): float(trip.get("routeLength", "nan")) for trip in trips}
    lengths = network.lengths
    assert found == pytest.approx(
        {k: float(lengths[a >> 1] + lengths[b >> 1]) for k, (a, b) in enumerate(pairs)}, abs=1e-3
    )


def test_cars_of_sumo_drive_through_it(network: RoadNetwork, tmp_path: Path) -> None:
    """duarouter finds the ways of cars from anywhere to anywhere; sumo lets all of them in, and none is moved on."""
    network.write(tmp_path / "town.net.xml")
    dice = Random(7)
    names = [name for s in range(len(network.segments)) for name in (f"s{s}", f"-s{s}")]
    trips = "".join(
        f'<trip id="{k}" type="car" depart="{EVERY_S * k}" departPos="0" from="{a}" to="{b}"/>'
        for k, (a, b) in enumerate(dice.sample(names, 2) for _ in range(CARS))
    )
    (tmp_path / "trips.xml").write_text(f"<routes>{CAR}{trips}</routes>")
    run(
        tmp_path,
        "duarouter",
        "-n",
        "town.net.xml",
        "-r",
        "trips.xml",
        "-o",
        "routes.rou.xml",
        "--no-step-log",
    )
    run(
        tmp_path, "sumo", "-n", "town.net.xml", "-r", "routes.rou.xml", "--tripinfo-output", "done.xml",
        "--statistic-output", "statistics.xml", "--no-step-log", "--precision", "6",
    )  # fmt: skip
    told = ElementTree.parse(tmp_path / "statistics.xml").getroot()
    counts = {each.tag: each.attrib for each in told}
    assert counts["vehicles"] == {"loaded": f"{CARS}", "inserted": f"{CARS}", "running": "0", "waiting": "0"}
    assert counts["teleports"]["total"] == counts["safety"]["collisions"] == "0"
    lengths = dict(zip(names, np.repeat(network.lengths, 2).tolist(), strict=True))
    routes = ElementTree.parse(tmp_path / "routes.rou.xml").getroot()
    wanted = {
        car.get("id"): sum(lengths[edge] for edge in way.get("edges", "").split())
        for car in routes.iter("vehicle")
        for way in car.iter("route")
    }
    done = ElementTree.parse(tmp_path / "done.xml").getroot().iter("tripinfo")
    assert {trip.get("id"): float(trip.get("routeLength", "nan")) for trip in done} == pytest.approx(wanted, abs=1e-3)


def test_what_netconvert_makes_of_ours_is_read_again(tmp_path: Path) -> None:
    """Its OpenDRIVE has roads that end before junctions, and roads that connect them there."""
    network = RoadNetwork.grid(3, 4, 60.0)
    network.write(tmp_path / "town.net.xml")
    run(
        tmp_path,
        "netconvert",
        "-s",
        "town.net.xml",
        "--default.junctions.radius",
        "4",
        "--opendrive-output",
        "a.xodr",
    )
    text = (tmp_path / "a.xodr").read_text()
    assert text.count('junction="-1"') < text.count("<road ")
    document, losses = OpenDrive().reduced(text, settings=ImportSettings(scale=1.0))
    again = RoadNetwork.from_document(document)
    assert losses.kept_share > 0.99
    # Junctions of two roads vanish at an import: both become one segment that bends.
    found, wanted = (each.points[each.degrees >= 3] for each in (again, network))
    assert sorted(again.degrees.tolist()) == sorted(network.degrees[network.degrees >= 3].tolist())
    assert close((found - found.min(axis=0)).tolist(), (wanted - wanted.min(axis=0)).tolist(), 0.05)
