"""Broken maps of other programs: each is refused with its file, what is wrong, and where."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from dubins_traffic.cli.main import main
from dubins_traffic.errors import InputError
from dubins_traffic.maps import xml_text
from dubins_traffic.roads.formats import registry
from dubins_traffic.roads.network import RoadNetwork
from tests.foreign_maps import FOREIGN, both, changed, opendrive, sumo, written

Make = Callable[[], str]
OSM_HEAD = "<osm version='0.6'>"
NODES = "<node id='1' lat='49' lon='9'/><node id='2' lat='49.001' lon='9'/>"
WAY = "<way id='5'><nd ref='1'/><nd ref='2'/><tag k='highway' v='residential'/></way>"
LINE = '<geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry>'
BOMB = '<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>'
ENDLESS = '<!DOCTYPE r [<!ENTITY a "&b;"><!ENTITY b "&a;">]>'
OUTER = '<!DOCTYPE r SYSTEM "file:///etc/passwd">'
ROOTS = {"commonroad": "commonRoad", "lanelet2": "osm", "opendrive": "OpenDRIVE", "sumo": "net", "osm": "osm"}


def text(value: str) -> Make:
    return lambda: value


def inner(name: str, old: str, new: str) -> Make:
    return changed(name, old, new)


def general() -> list[tuple[str, str, Make, str]]:
    """What is refused in every format."""
    found: list[tuple[str, str, Make, str]] = []
    for name in FOREIGN:
        root = ROOTS[name]
        found += [
            (name, "truncated", lambda name=name: written(name)[: len(written(name)) // 2], "not XML"),
            (name, "entity bomb", text(f"{BOMB}<{root}>&b;</{root}>"), "document type"),
            (name, "entity loop", text(f"{ENDLESS}<{root}>&a;</{root}>"), "document type"),
            (name, "outer entity", text(f"{OUTER}<{root}/>"), "document type"),
            (name, "other root", text("<html><body/></html>"), "another root"),
            (name, "nested", text("<a>" * 100 + "</a>" * 100), "nested too deep"),
            (name, "without roads", text(f"<{root}/>"), "no roads"),
            (name, "undefined entity", text(f"<{root}>&lol;</{root}>"), "not XML"),
            (name, "attribute twice", text(f"<{root} a='1' a='2'/>"), "not XML"),
        ]
    return found


FAR = {f"{end}{k}": (9e4 * (end == "b"), 100.0 * k) for k in range(20) for end in "ab"}
SUMO: list[tuple[str, Make, str]] = [
    ("NaN", inner("sumo", ' x="0"', ' x="nan"'), "not a number"),
    ("infinite", inner("sumo", ' x="0"', ' x="1e999"'), "not a number"),
    ("gigantic", inner("sumo", ' x="0"', ' x="1e12"'), "not a place"),
    ("word", inner("sumo", 'y="0"', 'y="north"'), "not a number"),
    ("digits without end", inner("sumo", 'y="0"', f'y="{"1" * 5000}"'), "not a number"),
    ("no x", inner("sumo", ' x="0"', ' z="0"'), "missing"),
    ("junction twice", inner("sumo", '<junction id="v1"', '<junction id="v0"'), "stands twice"),
    ("no such junction", inner("sumo", 'from="v0"', 'from="nowhere"'), "no such junction"),
    ("no id", inner("sumo", '<edge id="s0"', "<edge"), "missing"),
    ("no lanes", text(sumo(["a b 0", "b a 0"], {"a": (0, 0), "b": (90, 0)})), "no lanes"),
    ("half a point", text(sumo(["a b 1 shape='1,2 3'"], {"a": (0, 0), "b": (90, 0)})), "not a point"),
    ("one point", text(sumo(["a b 1 shape='1,2'"], {"a": (0, 0), "b": (90, 0)})), "not a line"),
    ("width", inner("sumo", 'width="0.6"', 'width="-1"'), "width of a lane"),
    ("endless road", text(sumo(both("a b 1"), {"a": (0, 0), "b": (9e6, 0)})), "too long"),
    ("half the world", text(sumo([f"a{k} b{k} 1" for k in range(20)], FAR)), "too large a map"),
    ("loop of one point", text(sumo(["a a 1 shape='0,0 0,0'"], {"a": (0, 0)})), "nothing of the map"),
    ("all too short", text(sumo(both("a b 1"), {"a": (0, 0), "b": (3, 0)})), "nothing of the map"),
    ("frame", inner("sumo", "frame 3.0", "frame three"), "not numbers"),
    ("other instruction", inner("sumo", "frame 3.0", "fame 3.0"), "unknown instruction"),
]
OFFSET = opendrive(LINE).replace("<lanes>", '<lanes><laneOffset s="{s}" a="{a}" b="0" c="0" d="0"/>')
OPENDRIVE: list[tuple[str, Make, str]] = [
    ("no geometry", text(opendrive("")), "has no line"),
    ("no shape", text(opendrive(LINE.replace("<line/>", ""))), "not one shape"),
    ("two shapes", text(opendrive(LINE.replace("<line/>", "<line/><arc curvature='1'/>"))), "not one shape"),
    ("negative length", text(opendrive(LINE.replace('"100"', '"-1"'))), "not a length"),
    ("endless", text(opendrive(LINE.replace('"100"', '"1e99"'))), "not a length"),
    ("beyond numbers", text(opendrive(LINE.replace('"100"', '"1e300"'))), "too large: got '1e300'"),
    ("no length", text(opendrive(LINE.replace('"100"', '"0"'))), "no length"),
    (
        "gap",
        text(opendrive(LINE + LINE.replace('s="0" x="0"', 's="100" x="1e7"'))),
        "not where the piece before ends: got '1e.07 m away'",
    ),
    ("curvature", text(opendrive(LINE.replace("<line/>", '<arc curvature="1e9"/>'))), "too sharp"),
    ("no curvature", text(opendrive(LINE.replace("<line/>", "<arc/>"))), "missing"),
    (
        "coefficients",
        text(opendrive(LINE.replace("<line/>", '<poly3 a="0" b="1e99" c="0" d="0"/>'))),
        "too large",
    ),
    ("no lanes", text(opendrive(LINE).replace("laneSection", "other")), "has no lanes"),
    (
        "no such road",
        text(opendrive(LINE, link='<link><successor elementId="9"/></link>')),
        "linked to no road",
    ),
    ("lane offset", text(OFFSET.format(s="0", a="1e300")), "too large"),
    ("lane offset nowhere", text(OFFSET.format(s="nan", a="1")), "not a number"),
    ("heading", text(opendrive(LINE.replace('hdg="0"', 'hdg="NaN"'))), "not a number"),
]
COMMONROAD: list[tuple[str, Make, str]] = [
    ("no bound", inner("commonroad", "leftBound", "middleBound"), "not XML"),
    (
        "empty bound",
        text("<commonRoad><lanelet id='1'><leftBound/><rightBound/></lanelet></commonRoad>"),
        "no line",
    ),
    ("no bounds", text("<commonRoad><lanelet id='1'/></commonRoad>"), "missing"),
    ("successor", inner("commonroad", '<successor ref="', '<successor ref="99'), "no lanelet"),
    ("lanelet twice", inner("commonroad", '<lanelet id="2"', '<lanelet id="1"'), "stands twice"),
    ("empty coordinate", inner("commonroad", "<x>0</x>", "<x/>"), "not a number"),
    ("gigantic", inner("commonroad", "<x>0</x>", "<x>1e15</x>"), "not a"),
    ("beyond numbers", inner("commonroad", "<x>0</x>", "<x>-1e308</x>"), "leftBound: too large"),
]
LANELET2: list[tuple[str, Make, str]] = [
    ("no such node", inner("lanelet2", '<nd ref="', '<nd ref="x'), "no such node"),
    ("no bound", inner("lanelet2", 'role="left"', 'role="middle"'), "no left bound"),
    ("way of one node", text(f"{OSM_HEAD}{NODES}<way id='5'><nd ref='1'/></way><way id='6'/>"
                             "<relation id='7'><member type='way' ref='5' role='left'/>"
                             "<member type='way' ref='6' role='right'/><tag k='type' v='lanelet'/></relation></osm>"),
     "no line"),
    ("node twice", inner("lanelet2", '<node id="2"', '<node id="1"'), "stands twice"),
    ("local metres", inner("lanelet2", 'k="local_x" v="0"', 'k="local_x" v="far"'), "not a number"),
    ("beyond numbers", inner("lanelet2", 'k="local_x" v="0"', 'k="local_x" v="1e308"'), "too large"),
]  # fmt: skip
OSM: list[tuple[str, Make, str]] = [
    ("latitude", text(f"{OSM_HEAD}{NODES.replace('49.001', '149')}{WAY}</osm>"), "out of range"),
    ("no longitude", text(f"{OSM_HEAD}{NODES.replace('lon', 'long')}{WAY}</osm>"), "missing"),
    ("half the world", text(f"{OSM_HEAD}{NODES}"
                            f"<node id='3' lat='1' lon='150'/>{WAY}</osm>"), "too wide"),
    ("node", text(f"{OSM_HEAD}{WAY}</osm>"), "no such node"),
    ("footway only", text(f"{OSM_HEAD}{NODES}{WAY.replace('residential', 'footway')}</osm>"), "no roads"),
]  # fmt: skip
CASES = general() + [
    (name, what, make, words)
    for name, cases in (
        ("sumo", SUMO),
        ("opendrive", OPENDRIVE),
        ("commonroad", COMMONROAD),
        ("lanelet2", LANELET2),
        ("osm", OSM),
    )
    for what, make, words in cases
]


@pytest.mark.parametrize(("name", "what", "make", "words"), CASES, ids=[f"{case[0]}-{case[1]}" for case in CASES])
def test_a_broken_map_is_refused_with_its_file(name: str, what: str, make: Make, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        RoadNetwork.from_text(make(), "broken.map", registry.load(name))
    assert caught.value.file == "broken.map", what


@pytest.mark.parametrize(
    ("link", "words"),
    [
        ("<successor ref='1'/>", "nothing of the map"),
        ("<adjacentRight ref='1' drivingDir='same'/>", "no roads"),
    ],
)
def test_a_lanelet_that_leads_to_itself_is_refused(link: str, words: str) -> None:
    side = "<point><x>0</x><y>{0}</y></point><point><x>90</x><y>{0}</y></point>"
    bounds = f"<leftBound>{side.format(3)}</leftBound><rightBound>{side.format(0)}</rightBound>"
    text = f"<commonRoad><lanelet id='1'>{bounds}{link}</lanelet></commonRoad>"
    with pytest.raises(InputError, match=words):
        RoadNetwork.from_text(text, "ring.xml", registry.load("commonroad"))


WHOLE = f"<?xml version='1.0'?>\n{OSM_HEAD}\n{NODES}\n{WAY}\n</osm>"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (f"{OSM_HEAD}{NODES}</osm>", "no roads: got '2 nodes and 0 ways'; expected at least one way"),
        (f"{OSM_HEAD}</osm>", "no roads: got '0 nodes and 0 ways'"),
        (WHOLE[:-3], "not XML"),
        (WHOLE[: WHOLE.index("<way")], "not XML"),
        (WHOLE[:30], "not XML"),
        (WHOLE[:22], "XML that ends before its root; expected a whole map"),
        (WHOLE[:1], "XML that ends before its root"),
        (f"\ufeff\n {WHOLE[:22]}", "XML that ends before its root"),
        ("<!-- a: b --><html><body/></html>", "XML that is no map: its root is <html>"),
    ],
)
def test_xml_that_is_no_whole_map_is_not_taken_for_plain_text(
    text: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "town.osm"
    file.write_text(text)
    configuration = tmp_path / "config.json"
    configuration.write_text(json.dumps({"version": 1, "problem_domain": "dubins_traffic", "rnd": str(file)}))
    for command in (
        ["network", "--from"],
        ["convert", "-o", str(tmp_path / "a.json")],
        ["plot"],
        ["instance"],
    ):
        assert main([*command, str(configuration if command == ["instance"] else file)]) == 2
        told = capsys.readouterr().err
        assert words in told
        assert str(file) in told
        assert "RND" not in told


def test_what_is_too_large_is_refused_before_it_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(xml_text, "MOST_SIGNS", 100)
    with pytest.raises(InputError, match="too large"):
        RoadNetwork.from_text(written("sumo"), "large.net.xml", registry.load("sumo"))
    monkeypatch.undo()
    monkeypatch.setattr(xml_text, "MOST_ELEMENTS", 10)
    with pytest.raises(InputError, match="too many elements"):
        RoadNetwork.from_text(written("sumo"), "large.net.xml", registry.load("sumo"))
