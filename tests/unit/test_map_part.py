"""Parts of maps: which roads they hold, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dubins_traffic.cli.main import main
from dubins_traffic.errors import InputError
from dubins_traffic.maps.model import Junction, Road, RoadMap
from dubins_traffic.maps.part import Around, Clip, part_of

VILLAGE = str(Path(__file__).parents[2] / "examples" / "maps" / "village.net.xml")
SIDE = 5


def lattice() -> RoadMap:
    """Return a map of roads of 100 m between 5 by 5 junctions."""
    places = {f"{x}{y}": Junction(100.0 * x, 100.0 * y) for x in range(SIDE) for y in range(SIDE)}
    roads = [
        Road(f"{a}-{b}", a, b, np.array([places[a][:2], places[b][:2]]), 1, 1, 3.2)
        for a in places
        for b in places
        if a < b and (int(b[0]) - int(a[0]), int(b[1]) - int(a[1])) in ((1, 0), (0, 1))
    ]
    return RoadMap(places, roads)


@given(low=st.integers(-50, 400), size=st.integers(101, 500))
def test_a_part_has_the_roads_that_lie_wholly_in_it_and_their_junctions(low: int, size: int) -> None:
    box = Clip(low, low, low + size, low + size)
    inside = [k for k in range(SIDE) if low <= 100 * k <= low + size]
    try:
        found = part_of(lattice(), box)
    except InputError:
        assert len(inside) < 2
        return
    assert len(found.roads) == 2 * len(inside) * (len(inside) - 1)
    assert set(found.junctions) == {f"{x}{y}" for x in inside for y in inside}


def test_a_radius_counts_from_the_junction_to_all_of_a_road() -> None:
    found = part_of(lattice(), Around("22", 150.0))
    assert len(found.roads) == 12
    assert "00" not in found.junctions
    assert len(part_of(lattice(), Around("22", 100.0)).roads) == 4


@pytest.mark.parametrize(
    ("part", "says"),
    [
        (
            ("--around", "markt", "100"),
            "no such junction: got 'markt'; expected one of the map's 8, such as market, ",
        ),
        (("--around", "market", "-1"), "--around: not a radius: got -1.0"),
        (("--around", "market", "10"), "--around market 10: no road lies wholly in this part"),
        (("--around", "market", "160"), "no loop is left of the map"),
        (("--clip", "0,0,1"), "--clip: not a rectangle: got '0,0,1'; expected X0,Y0,X1,Y1"),
        (("--clip", "0,0,0,nan"), "--clip: not a rectangle"),
        (("--clip", "0,0,9,9", "--around", "market", "9"), "two parts at once"),
    ],
)
def test_a_part_that_can_not_be_driven_is_refused(
    part: tuple[str, ...], says: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    output = tmp_path / "part.json"
    assert main(["network", "--from", VILLAGE, *part, "-o", str(output)]) == 2
    assert says in capsys.readouterr().err
    assert not output.exists()


def test_only_maps_of_other_programs_have_parts(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["network", "--grid", "3", "3", "--clip", "0,0,9,9"]) == 2
    assert "--clip: nothing to reduce" in capsys.readouterr().err


def test_a_part_is_a_network(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole, part = tmp_path / "whole.json", tmp_path / "part.json"
    assert main(["network", "--from", VILLAGE, "-o", str(whole)]) == 0
    assert main(["network", "--from", VILLAGE, "--clip=-200,-200,400,400", "-o", str(part)]) == 0
    assert whole.read_bytes() == part.read_bytes()
    assert main(["network", "--from", VILLAGE, "--around", "market", "215", "-o", str(part), "--overwrite"]) == 0
    assert "5 segments of 7 roads" in capsys.readouterr().err


def test_what_was_lost_is_told_where_no_loop_is_left(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    told = tmp_path / "lost.json"
    part = ("--around", "market", "160", "--losses", str(told))
    assert main(["network", "--from", VILLAGE, *part, "-o", str(tmp_path / "part.json")]) == 2
    assert "no loop is left of the map: got '" in capsys.readouterr().err
    assert {road["fate"] for road in json.loads(told.read_text())["roads"]} >= {"kept"}
