"""Pairs of one-way roads beside each other that become one road (`maps.pairs`)."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dubins_traffic.cli.main import main
from dubins_traffic.maps.model import Junction, Road, RoadMap
from dubins_traffic.maps.pairs import merged
from dubins_traffic.maps.reduction import reduction
from dubins_traffic.maps.settings import ImportSettings
from dubins_traffic.roads.network import RoadNetwork


def road(made: dict[str, Junction], first: str, last: str, lanes: tuple[int, int] = (1, 0), width: float = 3.2) -> Road:
    line = np.array([made[first][:2], made[last][:2]])
    return Road(f"{first}{last}", first, last, line, *lanes, width)


def street(*, apart: float = 14.0, left: bool = False) -> RoadMap:
    """Return a street of two one-way roads along x, 600 m long, which a two-way road crosses in its middle.

    Cars keep right, or left. The eastbound road has a junction at 200 m, where another one-way road leaves it.
    """
    south, north = (0.5 * apart, -0.5 * apart) if left else (-0.5 * apart, 0.5 * apart)
    made = {
        "a": Junction(0.0, south), "b": Junction(300.0, south), "c": Junction(600.0, south),
        "x": Junction(200.0, south),
        "f": Junction(0.0, north), "e": Junction(300.0, north), "d": Junction(600.0, north),
        "n": Junction(300.0, 300.0), "s": Junction(300.0, -300.0), "r": Junction(200.0, -250.0),
    }  # fmt: skip
    ways = ("ax", "xb", "bc", "de", "ef", "xr")
    lower, upper = ("b", "e") if south < north else ("e", "b")
    both = [("s", lower), (lower, upper), (upper, "n")]
    return RoadMap(made, [*(road(made, *way) for way in ways), *(road(made, *pair, (1, 1)) for pair in both)])


def kinds(found: RoadMap) -> Counter[str]:
    return Counter("pair" if own.pair else "both" if own.is_plain else "one-way" for own in found.roads)


def test_two_one_way_roads_are_one_in_their_middle_with_a_lane_each_way() -> None:
    found = merged(street(), 20.0)
    assert kinds(found) == {"pair": 3, "both": 2, "one-way": 1}
    pairs = [own for own in found.roads if own.pair]
    assert all(own.is_plain for own in pairs)
    assert sum(own.length for own in pairs) == pytest.approx(600.0)
    assert all(np.abs(own.line[:, 1]).max() < 1e-9 for own in pairs)


def test_where_a_road_leaves_one_of_both_the_other_is_cut_beside_it() -> None:
    found = merged(street(), 20.0)
    places = sorted(round(junction.x) for junction in found.junctions.values() if abs(junction.y) < 1e-9)
    assert places == [0, 200, 300, 600]
    ramp = next(own for own in found.roads if own.name == "xr")
    assert found.junctions[ramp.first][:2] == pytest.approx((200.0, 0.0))


def test_the_road_between_both_is_part_of_their_junction() -> None:
    assert not [own for own in merged(street(), 20.0).roads if own.name == "be"]


def test_each_metre_stands_for_two() -> None:
    before, after = street(), merged(street(), 20.0)
    one_way = sum(own.length for own in before.roads if not own.is_plain and own.name != "xr")
    assert one_way == pytest.approx(2.0 * sum(own.length for own in after.roads if own.pair))


def test_roads_too_far_apart_or_on_the_wrong_side_stay_as_they_are() -> None:
    for whole in (street(apart=21.0), street(left=True)):
        found = merged(whole, 20.0)
        assert kinds(found) == {"both": 3, "one-way": 6}
        assert {own.name for own in found.roads} == {own.name for own in whole.roads}
        assert set(found.junctions) == set(whole.junctions)


def test_two_such_streets_cross_in_one_junction() -> None:
    """Each of the four crossings of two one-way roads is a junction of the map; a town has hundreds of them."""
    made = {name: Junction(x, y) for name, x, y in (
        ("sw", -7.0, -7.0), ("se", 7.0, -7.0), ("ne", 7.0, 7.0), ("nw", -7.0, 7.0),
        ("ws", -300.0, -7.0), ("wn", -300.0, 7.0), ("es", 300.0, -7.0), ("en", 300.0, 7.0),
        ("sW", -7.0, -300.0), ("sE", 7.0, -300.0), ("nW", -7.0, 300.0), ("nE", 7.0, 300.0),
    )}  # fmt: skip
    ways = [("ws", "sw"), ("sw", "se"), ("se", "es"), ("en", "ne"), ("ne", "nw"), ("nw", "wn"),
            ("sE", "se"), ("se", "ne"), ("ne", "nE"), ("nW", "nw"), ("nw", "sw"), ("sw", "sW")]  # fmt: skip
    found = merged(RoadMap(made, [road(made, *way) for way in ways]), 20.0)
    assert kinds(found) == {"pair": 4}
    assert len(found.junctions) == 5
    middle = next(junction for junction in found.junctions.values() if max(map(abs, junction[:2])) < 1.0)
    assert middle[:2] == pytest.approx((0.0, 0.0))


def test_a_road_against_its_line_counts_as_it_is_driven() -> None:
    whole = street()
    turned = [
        Road(own.name, own.last, own.first, own.line[::-1].copy(), own.backward, own.forward, own.lane_width)
        for own in whole.roads
    ]
    again = merged(RoadMap(whole.junctions, turned), 20.0)
    assert kinds(again) == {"pair": 3, "both": 2, "one-way": 1}


def test_a_network_holds_them_and_tells_of_it() -> None:
    document, losses = reduction(street(), ImportSettings(pairs=20.0))
    network = RoadNetwork.from_document(document)
    assert len(network.segments) == 4
    assert ("altered", "two one-way roads beside each other", 3, pytest.approx(600.0)) in losses.rows()
    assert losses.kept_share > 0.95
    without = reduction(street()).losses
    assert without.plain_length == pytest.approx(600.0)
    assert not [row for row in without.rows() if "beside" in row[1]]


def test_doubled_points_and_loops_do_no_harm() -> None:
    whole = street()
    rounds = np.array([[0.0, 7.0], [-20.0, 7.0], [-20.0, 20.0], [0.0, 20.0], [0.0, 7.0]])
    doubled = [replace(own, line=np.repeat(own.line, 2, axis=0)) for own in whole.roads]
    loop = Road("round", "f", "f", rounds, 1, 0, 3.2)
    found = merged(RoadMap(whole.junctions, [*doubled, loop]), 20.0)
    assert kinds(found) == {"pair": 3, "both": 2, "one-way": 2}


def test_a_map_without_one_way_roads_is_left_alone() -> None:
    made = {"p": Junction(0.0, 0.0), "q": Junction(100.0, 0.0)}
    whole = RoadMap(made, [road(made, "p", "q", (1, 1))])
    assert merged(whole, 20.0) is whole


NET = """<net version="1.20">
{edges}
{junctions}
</net>
"""


@pytest.fixture
def town(tmp_path: Path) -> Path:
    """Write the street as SUMO does."""
    edges, whole = list[str](), street()
    for own in whole.roads:
        for first, last, lanes in ((own.first, own.last, own.forward), (own.last, own.first, own.backward)):
            if lanes:
                name = f"{first}{last}"
                edges.append(
                    f'<edge id="{name}" from="{first}" to="{last}">'
                    f'<lane id="{name}_0" index="0" length="9" speed="9"/></edge>'
                )
    junctions = [
        f'<junction id="{name}" type="priority" x="{one.x}" y="{one.y}"/>' for name, one in whole.junctions.items()
    ]
    file = tmp_path / "town.net.xml"
    file.write_text(NET.format(edges="\n".join(edges), junctions="\n".join(junctions)))
    return file


def test_the_command_line_makes_pairs_one_road(town: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "town.json"
    assert main(["network", "--from", str(town), "--pairs", "20", "-o", str(output)]) == 0
    assert "altered      3     600  two one-way roads beside each other" in capsys.readouterr().err
    assert len(RoadNetwork.read(output).segments) == 4


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (
            ("--from", "{town}", "--pairs", "-1"),
            "pairs: out of range: got -1.0; expected a number in [1, 200]",
        ),
        (("--from", "{town}", "--pairs", "nan"), "pairs: out of range: got nan"),
        (("--grid", "3", "3", "--pairs", "20"), "--pairs: nothing to reduce"),
    ],
)
def test_other_distances_are_refused(
    words: tuple[str, ...], says: str, town: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "town.json"
    assert main(["network", *(word.format(town=town) for word in words), "-o", str(output)]) == 2
    assert says in capsys.readouterr().err
    assert not output.exists()
