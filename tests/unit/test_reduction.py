"""What a network holds of a map, why the rest is dropped or altered, and how that is told."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.sax.saxutils import quoteattr

import pytest

from dubins_traffic.cli.main import main
from dubins_traffic.errors import InputError
from dubins_traffic.maps import reduction
from dubins_traffic.maps.losses import Losses, Reason
from dubins_traffic.maps.opendrive import OpenDrive, Placed, clothoid
from dubins_traffic.maps.osm import OpenStreetMap
from dubins_traffic.maps.settings import ImportSettings
from dubins_traffic.maps.sumo import SumoNet
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.roads.clearance import clearance_faults
from dubins_traffic.roads.formats import registry
from dubins_traffic.roads.network import RoadNetwork
from tests.foreign_maps import BENT, both, opendrive, sumo, written
from tests.room import lacking

CROSS: Mapping[str, tuple[float, float]] = {
    "o": (0.0, 0.0),
    "n": (0.0, 90.0),
    "e": (80.0, 0.0),
    "s": (0.0, -90.0),
    "w": (-80.0, 0.0),
}
ROADS = both("o n 1", "o e 1", "o s 1", "o w 1")


def reduced(edges: Sequence[str], nodes: Mapping[str, tuple[float, float]]) -> tuple[RoadNetwork, Losses]:
    """Return the network to which a net of SUMO is reduced, and what was lost."""
    document, losses = SumoNet().reduced(sumo(edges, nodes))
    network = RoadNetwork.from_document(document)
    assert lacking(network) == []
    return network, losses


def fates(losses: Losses) -> dict[str, tuple[str, str]]:
    """Return for each road what became of it, and the main reason."""
    return {fate.name: (fate.fate, str(fate.reasons[0]) if fate.reasons else "") for fate in losses.fates}


def test_a_crossing_is_held_whole_at_its_scale() -> None:
    network, losses = reduced(ROADS, CROSS)
    assert losses.is_whole
    assert losses.kept_share == 1.0
    assert losses.scale == pytest.approx(0.6 / 3.2)
    assert sorted(network.lengths.tolist()) == pytest.approx([15.0, 15.0, 16.875, 16.875])
    assert network.degrees.max() == 4


def test_a_fifth_road_goes() -> None:
    network, losses = reduced([*ROADS, *both("o q 1")], {**CROSS, "q": (33.0, 33.0)})
    assert network.degrees.max() == 4
    assert fates(losses)["oq"] == ("dropped", Reason.DEGREE)


def test_one_way_roads_and_wide_ones_join_what_would_be_apart() -> None:
    nodes = {**CROSS, "f": (160.0, 0.0), "g": (240.0, 0.0), "h": (480.0, 0.0), "i": (160.0, 80.0)}
    edges = [*ROADS, "e f 1", *both("f g 2", "g h 1"), "f i 1"]
    network, losses = reduced(edges, nodes)
    found = fates(losses)
    assert found["ef"] == ("altered", Reason.ONE_WAY)
    assert found["fg"] == ("altered", Reason.LANES)
    assert found["gh"] == ("kept", "")
    assert found["fi"] == ("dropped", Reason.ONE_WAY)
    assert len(network.segments) == 4


def test_roads_that_nothing_joins_go() -> None:
    nodes = {**CROSS, "x": (500.0, 0.0), "y": (500.0, 100.0)}
    _, losses = reduced([*ROADS, *both("x y 1")], nodes)
    assert fates(losses)["xy"] == ("dropped", Reason.APART)
    assert losses.kept_share == pytest.approx(340.0 / 440.0)


def test_short_roads_are_drawn_together_or_go() -> None:
    nodes = {**CROSS, "p": (8.0, 0.0), "u": (8.0, 70.0), "k": (-80.0, 6.0)}
    network, losses = reduced(both("o n 1", "o s 1", "o p 1", "p e 1", "w k 1", "o w 1"), nodes)
    found = fates(losses)
    assert found["wk"][0] == "dropped" or found["wk"][0] == "altered"
    assert len(network.segments) == 4
    crowded, lost = reduced(both("o n 1", "o s 1", "o w 1", "o p 1", "p e 1", "p u 1"), nodes)
    assert fates(lost)["op"] == ("dropped", Reason.LENGTH)
    assert crowded.degrees.max() <= 4


def test_thousands_of_short_roads_go_in_seconds_and_leave_what_can_be_held() -> None:
    """They go many at once, and a round costs as much as the part of the map at which it looks."""
    count = 58
    nodes = {f"{x}-{y}": (1000.0 + x, float(y)) for x in range(count) for y in range(count)}
    upright = [f"{x}-{y} {x}-{y + 1} 1" for x in range(count) for y in range(count - 1)]
    level = [f"{x}-{y} {x + 1}-{y} 1" for x in range(count - 1) for y in range(count) if (x + y) % 2 == 0]
    network, losses = reduced([*ROADS, *both(*upright, *level)], {**CROSS, **nodes})
    assert len(upright + level) > 4900
    assert len(network.segments) == 4
    assert {name for name, (fate, _) in fates(losses).items() if fate == "kept"} == {"on", "oe", "os", "ow"}


def test_arms_too_near_each_other_are_turned_or_go() -> None:
    nodes = {"o": (0.0, 0.0), "a": (100.0, 0.0), "b": (70.0, 90.0), "c": (-100.0, 0.0), "d": (100.0, 25.0)}
    turned, losses = reduced(both("o a 1", "o b 1", "o c 1"), nodes)
    assert turned.degrees.max() == 3
    assert all(fate.fate != "dropped" for fate in losses.fates)
    _, dropped = reduced(both("o a 1", "o d 1", "o c 1", "o b 1"), nodes)
    assert "dropped" in {fate for fate, _ in fates(dropped).values()}


def test_a_bridge_is_not_held() -> None:
    nodes = {**CROSS, "a": (200.0, 40.0), "b": (40.0, -60.0), "c": (40.0, 120.0)}
    _, losses = reduced(both("o n 1", "o e 1", "o s 1", "n c 1", "c b 1"), nodes)
    assert ("dropped", Reason.CROSSING) in fates(losses).values()


def test_loops_and_twins_get_bends() -> None:
    nodes = {"o": (0.0, 0.0), "a": (120.0, 0.0), "e": (-90.0, 0.0), "f": (210.0, 0.0), "x": (60.0, 60.0)}
    arch = ["o x 1 shape='0,0 20,50 60,60'", "x o 1 shape='60,60 20,50 0,0'"]
    arch += ["x a 1 shape='60,60 100,50 120,0'", "a x 1 shape='120,0 100,50 60,60'"]
    network, losses = reduced([*both("o a 1", "e o 1", "a f 1"), *arch], nodes)
    assert losses.kept_share > 0.8
    assert len(network.intersections) == 5
    assert not network.is_straight


def test_what_kinds_of_roads_are_altered_is_told() -> None:
    edges = [each.replace(" 1", " 1 shape='0,0 40,3 80,0'", 1) if each.startswith("o e") else each for each in ROADS]
    edges = [each.replace(" 1", " 1 shape='80,0 40,3 0,0'", 1) if each.startswith("e o") else each for each in edges]
    network, losses = reduced(edges, CROSS)
    assert network.bent.sum() == 1
    assert losses.kept_share == 1.0


def test_a_scale_of_ones_own() -> None:
    text = sumo(ROADS, CROSS)
    document, losses = SumoNet().reduced(text, settings=ImportSettings(scale=0.5))
    assert losses.scale == 0.5
    assert sorted(RoadNetwork.from_document(document).lengths.tolist()) == [40.0, 40.0, 45.0, 45.0]
    assert losses.w == 0.3
    with pytest.raises(InputError, match="out of range"):
        ImportSettings(scale=-1.0)
    with pytest.raises(InputError, match="out of range"):
        ImportSettings(tolerance=float("nan"))


def test_lanes_of_ones_own_hold_as_much_at_the_scale_of_the_map() -> None:
    """At bends, wider roads need more room beside intersections: what is demanded grows with `w`."""
    edges = [
        *ROADS,
        *both("e f 1"),
        "f g 1 shape='160,0 200,3 230,40 235,90'",
        "g f 1 shape='235,90 230,40 200,3 160,0'",
    ]
    text = sumo(edges + both("f h 1"), {**CROSS, "f": (160.0, 0.0), "g": (235.0, 90.0), "h": (160.0, -80.0)})
    _, small = SumoNet().reduced(text)
    document, losses = SumoNet().reduced(text, settings=ImportSettings(scale=1.0), own_lanes=True)
    assert losses.w == pytest.approx(1.6)
    assert (losses.segments, losses.kept_share) == (small.segments, pytest.approx(small.kept_share))
    grown = losses.w / 0.3
    network = RoadNetwork.from_document(document)
    assert network.bent.any()
    assert clearance_faults(network, grown, 0.177 * grown, losses.w, 0.5 * grown) == []


def test_a_clothoid_of_opendrive_is_held() -> None:
    x, y = clothoid(Placed(40.0, 0.0, 0.0, 60.0), 0.0, 0.03)[-1].tolist()
    text = opendrive(
        '<geometry s="0" x="0" y="0" hdg="0" length="40"><line/></geometry>'
        '<geometry s="40" x="40" y="0" hdg="0" length="60"><spiral curvStart="0" curvEnd="0.03"/></geometry>'
        f'<geometry s="100" x="{x}" y="{y}" hdg="0.9" length="40"><line/></geometry>'
    )
    document, losses = OpenDrive().reduced(text)
    network = RoadNetwork.from_document(document)
    assert lacking(network) == []
    assert network.bent.all()
    assert losses.kept_share > 0.98


@pytest.mark.parametrize(
    ("width", "metres"),
    [("6", 3.0), ("6.5 m", 3.25), ("20 ft", 3.048), ("20'", 3.048), ("20'6\"", 3.1242), ("wide", 3.2)],
)
def test_the_width_of_a_road_of_openstreetmap_may_be_in_feet(width: str, metres: float) -> None:
    nodes = "<node id='1' lat='49' lon='9'/><node id='2' lat='49.001' lon='9'/>"
    tag = f"<tag k='highway' v='residential'/><tag k='width' v={quoteattr(width)}/>"
    text = f"<osm version='0.6'>{nodes}<way id='5'><nd ref='1'/><nd ref='2'/>{tag}</way></osm>"
    (road,) = OpenStreetMap().read_map(text).roads
    assert road.lane_width == pytest.approx(metres)


def test_a_map_too_far_from_its_origin_is_refused_as_the_map_that_it_is() -> None:
    far = {name: (5.4e6 + x, y) for name, (x, y) in CROSS.items()}
    with pytest.raises(InputError, match=r"road on: too far from the origin: got 5400000; expected .* 5.33333e\+06 m"):
        reduced(ROADS, far)


def test_openstreetmap_is_cut_where_ways_meet() -> None:
    nodes = "".join(
        f"<node id='{k}' lat='{49.0 + y / 1e4}' lon='{9.0 + x / 1e4}'/>"
        for k, (x, y) in enumerate([(0, 0), (10, 0), (20, 0), (10, 10), (10, -10)])
    )
    ways = [("0 1 2", "residential", ""), ("3 1 4", "primary", "<tag k='oneway' v='yes'/>")]
    ways_text = "".join(
        f"<way id='{k}'>{''.join(f'<nd ref={name!r}/>' for name in refs.split())}"
        f"<tag k='highway' v='{kind}'/>{more}</way>"
        for k, (refs, kind, more) in enumerate(ways)
    )
    text = f"<osm version='0.6'>{nodes}{ways_text}</osm>"
    assert registry.of_text(text).name == "osm"
    document, losses = OpenStreetMap().reduced(text)
    assert len(document["segments"]) == 1
    assert {name: fate for name, (fate, _) in fates(losses).items()} == {
        "0#0": "kept",
        "0#1": "kept",
        "1#0": "dropped",
        "1#1": "dropped",
    }
    # A ten-thousandth of a degree of longitude at 49 degrees is 7.3 m.
    assert losses.plain_length == pytest.approx(146.2, abs=0.3)


@pytest.fixture
def town(tmp_path: Path) -> Path:
    nodes = {**CROSS, "f": (160.0, 0.0)}
    file = tmp_path / "town.net.xml"
    file.write_text(sumo([*ROADS, "e f 1"], nodes))
    return file


def test_network_from_a_map_tells_what_was_lost(town: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = town.parent
    command = ["network", "--from", str(town), "-o", str(out / "town.json")]
    assert main([*command, "--losses", str(out / "losses.json"), "--losses", str(out / "losses.png")]) == 0
    told = capsys.readouterr().err
    assert "100.0 % kept within 0.1 m" in told
    assert "one-way" in told
    found = json.loads((out / "losses.json").read_text())
    assert found["one_plus_one"]["kept_share"] == 1.0
    assert {"fate": "dropped", "reason": "one-way", "roads": 1, "length": 80.0} in found["table"]
    assert (out / "losses.png").read_bytes().startswith(b"\x89PNG")
    assert main([*command, "--overwrite", "--losses", str(out / "losses.svg")]) == 0
    picture = (out / "losses.svg").read_text()
    for words in ("the network", "kept within the tolerance (340 m)", "dropped: one-way (1, 80 m)"):
        assert words in picture
    assert len(RoadNetwork.read(out / "town.json").segments) == 4
    assert main(["network", "--from", str(town), "--scale", "0.5", "-o", str(out / "large.json")]) == 0
    assert RoadNetwork.read(out / "large.json").lengths.max() == 45.0
    # Lanes of 3.2 m of the map at half its size: w from the file.
    assert "w = 0.8 m" in capsys.readouterr().err
    again = [*command[:-1], str(out / "own.json"), "--scale", "1", "--losses", str(out / "own-losses.json")]
    assert main(again) == 0
    assert json.loads((out / "own-losses.json").read_text())["w"] == 1.6
    own = RoadNetwork.read(out / "own.json")
    assert clearance_faults(own, 1.6 / 0.3, 0.177, 1.6) == []
    assert main([*again, "--overwrite", "--w", "0.3"]) == 0
    assert json.loads((out / "own-losses.json").read_text())["w"] == 0.3


def test_a_motorway_has_no_share_of_roads_with_one_lane_in_each_direction(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What is told is the share of all its roads; it was 100 % of nothing."""
    edges = ["a b 2", "b c 2", "b d 2 shape='80,0 150,3 154,60 158,62'"]
    nodes = {"a": (0.0, 0.0), "b": (80.0, 0.0), "c": (80.0, 90.0), "d": (158.0, 62.0)}
    file = tmp_path / "motorway.net.xml"
    file.write_text(sumo(edges, nodes))
    written = tmp_path / "losses.json"
    command = ["network", "--from", str(file), "-o", str(tmp_path / "a.json"), "--losses", str(written)]
    assert main(command) == 0
    found = json.loads(written.read_text())
    assert found["one_plus_one"] == {"length": 0.0, "kept_share": None}
    kept = sum(road["kept"] for road in found["roads"])
    assert 170.0 < kept < found["length"] - 1.0
    share = f"{100.0 * kept / found['length']:.1f} % kept within 0.1 m"
    whole = f"of {found['length']:.0f} m, none of them with one lane in each direction, {share}"
    assert whole in capsys.readouterr().err


@pytest.mark.parametrize("command", ["network", "convert"])
def test_what_can_not_be_held_says_why_and_writes_what_was_lost(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "short.net.xml"
    file.write_text(sumo([*both("a b 1"), "b c 1"], {"a": (0, 0), "b": (2, 0), "c": (2, 300)}))
    made, table, picture = (tmp_path / name for name in ("made.json", "losses.json", "losses.svg"))
    told = ["-o", str(made), "--losses", str(table), "--losses", str(picture)]
    start = [command, "--from", str(file)] if command == "network" else [command, str(file)]
    assert main([*start, *told]) == 2
    error = capsys.readouterr().err
    assert "nothing of the map can be held: one-way (1 road, 300 m); too short (1 road, 2 m)" in error
    assert "dropped      1       2  too short" in error
    assert [(row["fate"], row["reason"]) for row in json.loads(table.read_text())["table"]] == [
        ("dropped", "one-way"), ("dropped", "too short"),
    ]  # fmt: skip
    assert "dropped: too short (1, 2 m)" in picture.read_text()
    assert not made.exists()
    table.unlink()
    assert main([*start, *told[:4], "--losses", str(tmp_path / "losses.gif")]) == 2
    assert not table.exists()


def test_a_map_that_takes_too_many_attempts_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    nodes = {**CROSS, "q": (33.0, 33.0)}
    monkeypatch.setattr(reduction, "MOST_WORK", 1)
    with pytest.raises(InputError, match="too many attempts, with 1 of 5 roads dropped so far"):
        reduced([*ROADS, *both("o q 1")], nodes)


def test_network_from_a_map_refuses_what_makes_no_sense(town: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["network", "--from", str(town), "--grid", "2", "2"]) == 2
    assert main(["network", "--grid", "2", "2", "--losses", str(town.parent / "a.json")]) == 2
    assert main(["network", "--from", str(town), "--scale", "0"]) == 2
    assert main(["network", "--from", str(town), "--losses", str(town.parent / "a.gif")]) == 2
    assert main(["network", "--grid", "2", "2", "--scale", "2"]) == 2
    ours, made, report = (town.parent / name for name in ("ours.json", "made.json", "a.json"))
    ours.write_text(RoadNetwork.grid(2, 3).to_json())
    assert main(["network", "--from", str(ours), "--w", "0.3", "-o", str(made)]) == 2
    for losses in (town.parent / "none" / "a.json", town.parent / "a.gif", town.parent):
        assert main(["network", "--from", str(town), "--losses", str(losses), "-o", str(made)]) == 2
        assert main(["convert", str(town), "--losses", str(losses), "-o", str(made)]) == 2
    assert main(["convert", str(ours), "--losses", str(report), "-o", str(made)]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert "expected" in told.err
    assert not made.exists()
    assert not report.exists()


def test_convert_goes_from_format_to_format(town: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = town.parent
    last = town
    for name in ("a.xodr", "b.osm", "c.xml", "d.net.xml", "e.json"):
        assert main(["convert", str(last), "-o", str(out / name)]) == 0
        last = out / name
    assert "100.0 % kept" in capsys.readouterr().err
    network, again = RoadNetwork.read(out / "a.xodr"), RoadNetwork.read(out / "e.json")
    assert sorted(again.lengths.tolist()) == pytest.approx(sorted(network.lengths.tolist()), abs=1e-9)


def test_a_configuration_may_name_a_map_of_another_program(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "town.net.xml").write_text(written("sumo"))
    configuration = load_config("demo", rnd=tmp_path / "town.net.xml")
    assert configuration.network == RoadNetwork.grid(2, 3)
    document = json.loads(json.dumps(configuration.document)) | {"rnd": "town.net.xml"}
    (tmp_path / "own.json").write_text(json.dumps(document))
    assert main(["instance", str(tmp_path / "own.json")]) == 0
    told = capsys.readouterr()
    assert json.loads(told.out)["rnd"]["segments"] == RoadNetwork.grid(2, 3).to_document()["segments"]
    assert "7 segments of 7 roads" in told.err


def test_a_line_that_was_changed_is_believed_and_the_hint_is_not() -> None:
    text = written("sumo", BENT)
    assert SumoNet().reduced(text).losses.is_whole
    assert 'shape="0,0' in text
    moved = text.replace('id="s2"', 'id="s2" name="moved"').replace("20,8", "21,8")
    assert SumoNet().reduced(moved).document["segments"][0] == [0, 0, 20, 0]
    edited = text.replace(' shape="0,0 ', ' shape="0,0 -9,9 ')
    document, _ = SumoNet().reduced(edited)
    assert document["segments"] != [list(row) for row in BENT["segments"]]
