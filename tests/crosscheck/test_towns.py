"""The two largest towns with one lane in each direction that come with SUMO, as road networks."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest
from experiments import towns
from scripts import towns_suite

from dubins_traffic.errors import InputError
from dubins_traffic.maps.opendrive import OpenDrive
from dubins_traffic.maps.settings import ImportSettings
from dubins_traffic.maps.sumo import SumoNet
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.protocols import End
from dubins_traffic.roads.clearance import clearance_faults
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.runs.single import run_trial
from dubins_traffic.suites.suite import load_suite
from tests.minute import a_minute
from tests.room import lacking
from tests.tools import interpreter_with, sumo_program

pytestmark = pytest.mark.tools

TOWNS = {"DRT": 16_000.0, "bs3d": 5_600.0}
"""Towns of `experiments.towns`, and the least metres with one lane in each direction in them."""
LEAST = 0.85


def folder() -> Path:
    """Return where SUMO's own towns are."""
    environment = Path(interpreter_with("sumo")).parents[1]
    return next(environment.glob("lib/python*/site-packages/sumo/tools"))


@pytest.mark.parametrize("controller", ["lanes", "lanes+shield"])
def test_lanes_drives_where_arms_are_a_hair_off_straight(controller: str) -> None:
    """Of grid6 the roads go on 1e-9 to 2e-8 rad off straight."""
    document, _ = SumoNet().reduced((folder() / "game" / "grid6" / "grid6.net.xml").read_text())
    config = a_minute("junction").to_document() | {"rnd": dict(document), "duration": 5.0}
    ran = run_trial(draw(load_config(config), seed=0, trial=0), controller)
    assert ran.ending.end is End.DURATION


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
    assert {f"{name}.net.xml" for name in largest} == {towns.TOWNS[town] for town in TOWNS}


@pytest.mark.parametrize("town", TOWNS)
def test_a_town_is_kept(town: str) -> None:
    assert folder().is_dir()
    document, losses = towns.reduced(town)
    network = RoadNetwork.from_document(document)
    assert losses.tolerance == 0.1
    assert losses.plain_length >= TOWNS[town]
    assert losses.kept_share >= LEAST
    assert not network.is_straight
    assert clearance_faults(network, 1.0, 0.177, 0.3) == []
    assert lacking(network) == []


@pytest.mark.parametrize(("town", "number"), [("DRT", 0), ("DRT", 2), ("bs3d", 0), ("bs3d", 1)])
def test_rules_is_clean_there_among_lawful_cars(town: str, number: int) -> None:
    """A sample of `experiments.towns`; in all but the last, cars once turned off their lanes where they left discs."""
    assert folder().is_dir()
    one = towns.drive(number, town, 60.0)
    assert (one.own, one.others, one.collisions) == ((), (), 0)
    assert one.distance > 20.0


@pytest.mark.parametrize("town", sorted({*towns.MAPS} - {"DRT"}))
def test_rules_makes_counted_rounds_where_goals_are_within_reach(town: str) -> None:
    """A sample of `experiments.towns`, which runs ten trials on each of the ten maps."""
    assert folder().is_dir()
    one = towns.drive(0, town, drawn=towns.within_reach)
    assert one.clean
    assert one.counted >= 2


@pytest.mark.parametrize(("town", "most"), [("A10KW", 1_000.0), ("DRT", 2_000.0)])
def test_pairs_of_one_way_roads_are_held_as_one(town: str, most: float) -> None:
    """Metres dropped as one-way were 11,505 and 8,681 in these; `rules` drives on what is held."""
    before = towns.reduced(town).losses
    document, losses = SumoNet().reduced(towns.text_of(town), None, ImportSettings(pairs=25.0))
    dropped = [
        sum(metres for fate, why, _, metres in own.rows() if (fate, why) == ("dropped", "one-way"))
        for own in (before, losses)
    ]
    assert dropped[0] > 8_000.0
    assert dropped[1] < most
    network = RoadNetwork.from_document(document)
    assert clearance_faults(network, 1.0, 0.177, 0.3) == []
    assert lacking(network) == []
    config = a_minute("town").to_document() | {
        "network": None,
        "rnd": dict(document),
        "goal_round_share": 0.5,
    }
    config |= {"duration": 300, "number_goals_bounds": [1, 4]}
    score = run_trial(draw(load_config(config), seed=0, trial=0), "rules").score
    assert score.counted_rounds >= 1


def test_the_suite_of_towns_is_what_its_script_makes() -> None:
    """The last digits of an import may be others on another machine, so the suite is shipped as it was made once."""
    assert folder().is_dir()
    kept, made = load_suite("towns-2026").document, towns_suite.suite()
    pairs = zip(kept["campaign"]["configurations"], made["campaign"]["configurations"], strict=True)
    for one, other in pairs:
        rows = one["document"]["rnd"].pop("segments"), other["document"]["rnd"].pop("segments")
        assert [len(row) for row in rows[0]] == [len(row) for row in rows[1]]
        assert np.concatenate(rows[0]) == pytest.approx(np.concatenate(rows[1]), abs=1e-6)
    assert kept == made


def test_the_same_town_by_way_of_opendrive(tmp_path: Path) -> None:
    source = folder() / "game" / "bs3d" / "bs.net.xml"
    command = [
        sumo_program("netconvert"),
        "-s",
        str(source),
        "--opendrive-output",
        str(tmp_path / "bs.xodr"),
    ]
    subprocess.run(command, check=True, capture_output=True, timeout=600)
    document, losses = OpenDrive().reduced((tmp_path / "bs.xodr").read_text())
    assert losses.kept_share >= LEAST
    assert len(document["segments"]) == len(towns.reduced("bs3d").document["segments"])
