"""Pictures: what is in them, and that equal subjects give equal bytes."""

from __future__ import annotations

import re
import sys
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from shapely import MultiLineString

from dubins_traffic.animation.canvas import MARGIN
from dubins_traffic.animation.plot import write_plot
from dubins_traffic.errors import InputError, MissingExtraError
from dubins_traffic.record.reader import Record
from dubins_traffic.record.sink import End, Ending
from dubins_traffic.roads.generate import generate
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.viewer import palette
from dubins_traffic.viewer.scene import centre_lines, centre_paths, short
from dubins_traffic.viewer.shapes import KERB
from tests.synthetic import ROUGH, driven, instance, obstacles_beside


@pytest.fixture(scope="module")
def record() -> Record:
    grid = RoadNetwork.grid(3, 4)
    tried, frames = driven(instance(grid, cars=9, seconds=45.0, obstacles=obstacles_beside(grid)))
    return Record(tried, frames, (frames,), Ending(End.DURATION, len(frames) - 1), "simple", {})


@pytest.mark.parametrize(
    ("suffix", "magic"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF"), ("PNG", b"\x89PNG")]
)
def test_formats_follow_the_suffix_and_bytes_are_equal(
    tmp_path: Path, record: Record, suffix: str, magic: bytes
) -> None:
    first, second = tmp_path / f"first.{suffix}", tmp_path / f"second.{suffix}"
    write_plot(first, record)
    write_plot(second, record)
    data = first.read_bytes()
    assert data.startswith(magic)
    assert data == second.read_bytes()
    assert not re.search(rb"CreationDate|dc:date|20\d\d-\d\d-\d\d", data)
    assert sorted(path.name for path in tmp_path.iterdir()) == [first.name, second.name]


def test_roads_are_4w_wide_with_round_ends(tmp_path: Path) -> None:
    write_plot(tmp_path / "network.png", ROUGH)
    pixels = np.asarray(Image.open(tmp_path / "network.png").convert("RGB")).astype(int)
    ground = np.array([int(palette.GROUND_COLOUR[at : at + 2], 16) for at in (1, 3, 5)])
    bare = np.abs(pixels - ground).sum(axis=2) <= 2
    rows, columns = np.flatnonzero(bare.any(axis=1)), np.flatnonzero(bare.any(axis=0))
    whole = (rows[-1] - rows[0] + 1) * (columns[-1] - columns[0] + 1)
    centres = MultiLineString(list(ROUGH.points[ROUGH.ends]))
    left, bottom, right, top = centres.buffer(0.6).bounds
    box = (right - left + 2 * MARGIN) * (top - bottom + 2 * MARGIN)
    with_kerbs = centres.buffer(0.6 + KERB)
    assert 1.0 - bare.sum() / whole == pytest.approx(with_kerbs.area / box, rel=0.02)


def test_the_chords_of_a_bend_are_one_line_and_lines_of_straight_roads_stay() -> None:
    network = generate(9, 12, 4, bent=1.0)
    paths = centre_paths(network, 0.6)
    assert len(paths) == len(network.segments)
    assert max(len(path) for path in paths) > 6
    assert sum(len(path) - 1 for path in paths) == len(centre_lines(network, 0.6))
    straight = centre_paths(ROUGH, 0.6)
    assert np.array_equal(np.array(straight), centre_lines(ROUGH, 0.6))


def test_places_off_the_lattice_are_named_shortly(tmp_path: Path) -> None:
    assert [short(number) for number in (3, 12, 2.5, -2.437475584289642, -5.75e-11, 183.7)] == [
        "3", "12", "2.5", "-2.44", "0", "183.7",
    ]  # fmt: skip
    document = {"version": 2, "length": 1, "segments": [[-2.437475584289642, 0, 9, -5.75e-11]]}
    write_plot(tmp_path / "a.svg", RoadNetwork.from_document(document))
    text = (tmp_path / "a.svg").read_text()
    assert "-2.44,0" in text
    assert "-2.43747" not in text


def test_a_record_shows_goals_obstacles_paths_and_contacts(tmp_path: Path, record: Record) -> None:
    assert record.frames.contacts
    write_plot(tmp_path / "record.svg", record)
    write_plot(tmp_path / "instance.svg", record.instance)
    write_plot(tmp_path / "network.svg", record.instance.problem.network)
    texts = {name: (tmp_path / f"{name}.svg").read_text().lower() for name in ("record", "instance", "network")}
    for colour, where in (
        (palette.ROAD_COLOUR, {"record", "instance", "network"}),
        (palette.GOAL_COLOUR, {"record", "instance"}),
        (palette.OBSTACLE_COLOUR, {"record", "instance"}),
        (palette.EGO_COLOUR, {"record", "instance"}),
        (palette.CONTACT_COLOUR, {"record"}),
    ):
        assert {name for name, text in texts.items() if colour.lower() in text} == where
    path = re.compile(rf"<path [^>]*fill: none; stroke: {palette.EGO_COLOUR.lower()}")
    assert path.search(texts["record"])
    assert not path.search(texts["instance"])


def test_a_record_without_frames_is_refused(tmp_path: Path, record: Record) -> None:
    held = {each.name: getattr(record.frames, each.name) for each in fields(record.frames)}
    none = {name: value[:0] for name, value in held.items() if isinstance(value, np.ndarray | tuple)}
    empty = replace(record, blocks=(), frames=replace(record.frames, **none))
    with pytest.raises(InputError, match="nothing to draw: got 0; expected at least one frame"):
        write_plot(tmp_path / "empty.svg", empty)


def test_names_are_no_mathematics_and_a_crowd_has_room(tmp_path: Path) -> None:
    names = ("a$b", "$x_", "<tag>", *(f"car{number}" for number in range(20)))
    grid = RoadNetwork.grid(4, 5)
    write_plot(tmp_path / "crowd.svg", driven(instance(grid, 24, 1.0, names=names, rectangles=True))[0])
    text = (tmp_path / "crowd.svg").read_text()
    assert text.count('<g id="text_') > len(names) + len(grid.intersections)


def test_refusals_name_the_file_and_leave_nothing(tmp_path: Path) -> None:
    grid = RoadNetwork.grid(2, 2)
    with pytest.raises(InputError, match=r"a\.gif.*'\.gif'.*\.pdf, \.png, \.svg"):
        write_plot(tmp_path / "a.gif", grid)
    with pytest.raises(InputError, match=r"missing/a\.png"):
        write_plot(tmp_path / "missing" / "a.png", grid)
    (tmp_path / "folder.png").mkdir()
    with pytest.raises(InputError, match=r"folder\.png"):
        write_plot(tmp_path / "folder.png", grid)
    assert [path.name for path in tmp_path.iterdir()] == ["folder.png"]


def test_without_matplotlib_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingExtraError, match="plot"):
        write_plot(tmp_path / "a.png", RoadNetwork.grid(2, 2))
