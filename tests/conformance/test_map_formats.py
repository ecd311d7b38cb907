"""The suite of every map format: the registered ones, one of another package, and one from a file outside."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest

from dubins_traffic.cli.main import main
from dubins_traffic.errors import InputError
from dubins_traffic.maps.losses import Losses
from dubins_traffic.problem.configuration import load_config, shipped_names
from dubins_traffic.roads.formats import registry
from dubins_traffic.roads.formats.registry import MapFormat, ReducesMaps, WritesMaps
from dubins_traffic.roads.generate import generate
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.runs.sources import load
from tests.room import lacking

ROOT = Path(__file__).parents[2]
OUTSIDE = f"{ROOT / 'examples' / 'extending' / 'my_format.py'}:GridMap"
FORMATS = [*(name for name in registry.names() if isinstance(registry.load(name), WritesMaps)), OUTSIDE]
GRID = RoadNetwork.grid(2, 3)
NETWORKS = [
    GRID,
    replace(GRID, extra={"author": "somebody", "mine": "unknown keys survive"}),
    RoadNetwork.grid(1, 2, 2.5),
    RoadNetwork(((0, 0, 0, 1), (0, 1, 1, 1), (1, 1, 2, 1)), 4.0, (0.0, 0.0, 0.0), (2, 3)),
    RoadNetwork.grid(3, 4, 3.25, (1.5, -2.0, 0.7)),
    RoadNetwork(((0, 0, 2, 1), (2, 1, 3, 0)), 3.0, (0.0, 0.0, 0.0), (2, 4), {"author": "somebody # else"}),
    generate(9, 12, 3),
]
BENT = [
    RoadNetwork.from_document({"version": 2, "length": 1, "segments": [[0, 0, 20, 0, 10, 6, 4.5]]}),
    RoadNetwork.from_document(
        {
            "version": 2,
            "length": 1.25,
            "transform": [-3.5, 12.0, 2.1],
            "segments": [
                [0, 0, 20, 0],
                [0, 0, 10.5, 15.25, 0, 15, 3.1],
                [20, 0, 10.5, 15.25, 20.5, 7, 4.5, 17, 15.25, 1 / 3],
                [10.5, 15.25, 10, 30.123456789],
            ],
        }
    ),
]
"""Networks of segments that bend."""
OTHERS = ["", " \n", "{}", "[1]", "\x00\ufffd", "<osm version='0.6'/>", "a,b\n1,2\n", "no map at all", "grid"]


@pytest.fixture(params=FORMATS, ids=lambda spec: str(spec).rpartition("/")[2])
def form(request: pytest.FixtureRequest) -> MapFormat:
    return registry.load(request.param)


def written(form: MapFormat, network: RoadNetwork) -> str | None:
    """Return a network as a text, None if it is one that the format can't hold."""
    assert isinstance(form, WritesMaps)
    try:
        return form.write(network.to_document())
    except InputError:
        return None


def broken(form: MapFormat, text: str) -> str | None:
    """Return the file that is named when a text is refused, None if it is not refused."""
    try:
        RoadNetwork.from_text(text, "broken.map", form)
    except InputError as error:
        return error.file
    return None


def test_it_says_what_it_is(form: MapFormat) -> None:
    assert form.name == form.name.strip().lower()
    assert form.suffixes
    assert all(suffix.startswith(".") and suffix == suffix.lower() for suffix in form.suffixes)
    assert len(form.description) > 5
    assert "\n" not in form.description


def test_what_it_writes_it_reads_again(form: MapFormat) -> None:
    texts = [written(form, network) for network in NETWORKS]
    assert texts[0] is not None, "no format is without grids"
    for network, text in zip(NETWORKS, texts, strict=True):
        if text is not None:
            again = RoadNetwork.from_text(text, "town", form)
            assert sorted(again.segments) == sorted(network.segments)
            assert (again.length, again.transform) == (network.length, network.transform)
            assert again.shape == network.shape
            assert again.extra == ({} if isinstance(form, ReducesMaps) else network.extra)
            assert form.write(again.to_document()) == text  # pyright: ignore[reportAttributeAccessIssue]


@pytest.mark.parametrize("network", BENT, ids=("one", "four"))
def test_curves_come_back_to_a_nanometre(form: MapFormat, network: RoadNetwork) -> None:
    text = written(form, network)
    if text is None:
        return
    again = RoadNetwork.from_text(text, "town", form)
    assert np.abs(again.points - network.points).max() < 1e-9
    assert (again.ends == network.ends).all()
    assert np.abs(again.lengths - network.lengths).max() < 1e-9
    for lane in range(network.lanes):
        there, back = (each.lane_curve(lane, -0.3) for each in (network, again))
        assert there.shape == back.shape
        assert np.abs(there - back).max() < 1e-9


def test_it_knows_its_own_texts_and_no_others(form: MapFormat) -> None:
    own = written(form, GRID)
    assert own is not None
    assert form.sniff(own)
    for spec in FORMATS:
        other = registry.load(spec)
        if other.name != form.name:
            assert not form.sniff(written(other, GRID) or "")
    for text in OTHERS:
        assert not form.sniff(text), text


def test_a_broken_text_is_refused_with_its_file(form: MapFormat) -> None:
    whole = written(form, GRID) or ""
    for end in range(len(whole)):
        assert broken(form, whole[:end]) in (None, "broken.map")
    for text in OTHERS[2:]:
        assert broken(form, text) == "broken.map", text


def test_a_file_of_it_is_loaded_and_converted(form: MapFormat, tmp_path: Path) -> None:
    file = tmp_path / f"town{form.suffixes[0]}"
    GRID.write(file, form)
    found = load(file, map_format=form)
    assert isinstance(found, RoadNetwork)
    assert sorted(found.segments) == sorted(GRID.segments)
    spec = OUTSIDE if form.name not in registry.names() else form.name
    there, back = tmp_path / "there.json", tmp_path / f"back{form.suffixes[0]}"
    assert main(["convert", str(file), "-o", str(there), "--map-format", spec]) == 0
    assert main(["convert", str(there), "-o", str(back), "--map-format", spec]) == 0
    assert back.read_bytes() == file.read_bytes()
    assert json.loads(there.read_text())["version"] == 0


def test_further_formats_leave_other_files_alone(form: MapFormat, tmp_path: Path) -> None:
    for name in shipped_names():
        assert type(load(name, map_format=form)) is type(load(name))
    (tmp_path / "a.rnd").write_text(GRID.to_text())
    assert load(tmp_path / "a.rnd", map_format=form) == GRID


def test_a_format_of_another_package_is_found_by_its_entry_point(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A package is a folder with metadata on the path; the registry looks for it once a process."""
    (tmp_path / "other_maps.py").write_text((ROOT / "examples" / "extending" / "my_format.py").read_text())
    info = tmp_path / "other_maps-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: other-maps\nVersion: 1\n")
    entry = EntryPoint("grid-map", "other_maps:GridMap", registry.GROUP)
    (info / "entry_points.txt").write_text(f"[{entry.group}]\n{entry.name} = {entry.value}\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    registry.forget()
    try:
        file = tmp_path / "town.grid"
        GRID.write(file)
        assert file.read_text().startswith("grid-map 3")
        found = load(file)
        assert isinstance(found, RoadNetwork)
        assert "grid-map" in registry.names()
        configuration = load_config("demo", rnd=file)
        assert configuration.network == found
    finally:
        registry.forget()


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("class F: pass", "lacks the method sniff"),
        (
            "class F:\n    def sniff(self, text): return True\n    def read(self, text, file): return {}",
            "lacks name",
        ),
        ("class F:\n    def __init__(self): 1 / 0", "ZeroDivisionError"),
        ("import nowhere_at_all", "nowhere_at_all"),
        (
            "class F:\n    name, suffixes, description = 'f', ('.f',), 'of f'\n"
            "    def sniff(self, text): return True\n    def read(self, text, file): return 1 / 0",
            "the map format f raised ZeroDivisionError",
        ),
        (
            "class F:\n    name, suffixes, description = 'f', ('.f',), 'of f'\n"
            "    def sniff(self, text): return 1 / 0\n    def read(self, text, file): return {}",
            "in sniff",
        ),
    ],
)
def test_what_is_no_map_format_is_refused(code: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "bad.py").write_text(code)
    (tmp_path / "some.f").write_text("something")
    with pytest.raises(InputError, match=words):
        load(tmp_path / "some.f", map_format=f"{tmp_path / 'bad.py'}:F")


@pytest.mark.parametrize("file", sorted((ROOT / "examples" / "maps").iterdir()), ids=lambda file: file.name)
def test_the_maps_of_the_examples_are_held(file: Path) -> None:
    network = load(file)
    assert isinstance(network, RoadNetwork)
    losses = network.known[registry.LOSSES]
    assert isinstance(losses, Losses)
    assert losses.kept_share > 0.95
    assert network.degrees.max() >= 3
    assert lacking(network) == []
