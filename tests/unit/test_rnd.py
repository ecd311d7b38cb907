import io
import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from dubins_traffic.errors import InputError
from dubins_traffic.roads.network import RoadNetwork

GOOD: dict[str, Any] = {
    "version": 0,
    "length": 3,
    "transform": [0, 0, 0],
    "shape": [2, 2],
    "segments": [[0, 0, 0, 1], [0, 1, 1, 1], [1, 1, 1, 0], [1, 0, 0, 0]],
}
CROSS = [[0, 0, 1, 0], [0, 0, -1, 0], [0, 0, 0, 1], [0, 0, 0, -1]]


def _segments(*rows: Any, shape: Any = None) -> dict[str, Any]:
    document = {**GOOD, "segments": list(rows)}
    del document["shape"]
    return document if shape is None else {**document, "shape": shape}


BAD = [
    (_segments([0, 0, 2, 2], [2, 2, 2, 0], [2, 0, 0, 2]), "segments[2]", "crosses segments[0]"),
    (_segments([0, 0, 2, 0], [2, 0, 1, 0]), "segments[1]", "overlaps segments[0]"),
    (_segments([0, 0, 2, 0], [2, 0, 2, 1], [2, 1, 1, 0]), "segments[2]", "ends in the middle of segments[0]"),
    (
        _segments([1, 0, 2, 1], [2, 1, 2, 0], [2, 0, 0, 0]),
        "segments[2]",
        "passes through an end of segments[0]",
    ),
    (
        _segments([0, 0, 3, 0], [3, 0, 3, 1], [3, 1, 0, 1], [1, 0, 2, 0]),
        "segments[3]",
        "overlaps segments[0]",
    ),
    (_segments(*CROSS, [0, 0, 1, 1]), "segments[4]", "a fifth road at the intersection [0, 0]"),
    (_segments([0, 0, 1, 0], [1, 0, 1, 0]), "segments[1]", "zero length"),
    (_segments([0, 0, 1, 0], [1, 0, 0, 0]), "segments[1]", "the same road as segments[0]"),
    (_segments([0, 0, 1, 0], [1, 0, 1, 1], [5, 5, 6, 5]), "segments[2]", "disconnected from segments[0]"),
    (_segments(), "segments", "no segments"),
    (_segments([0, 0, 1, 0.5]), "segments[0][3]", "not a lattice coordinate"),
    (_segments([0, 0, 1, 0], [0, 0, "1", 1]), "segments[1][2]", "not a lattice coordinate"),
    (_segments([0, 0, 1, True]), "segments[0][3]", "not a lattice coordinate"),
    (_segments([0, 0, 10**30, 0]), "segments[0][2]", "not a lattice coordinate"),
    (_segments([0, 0, 1]), "segments[0]", "not a segment"),
    (_segments("0 0 1 0"), "segments[0]", "not a segment"),
    (_segments(7), "segments[0]", "not a segment"),
    ({**GOOD, "segments": {"a": 1}}, "segments", "not a list"),
    ({**GOOD, "shape": [2, 3]}, "shape", "shape differs"),
    ({**GOOD, "shape": [2]}, "shape", "not a shape"),
    ({**GOOD, "shape": [2, 0]}, "shape[1]", "not a shape"),
    ({**GOOD, "shape": [2.5, 2]}, "shape[0]", "not a shape"),
    ({**GOOD, "length": -1}, "length", "not a length"),
    ({**GOOD, "length": 0}, "length", "not a length"),
    ({**GOOD, "length": math.nan}, "length", "not a length"),
    ({**GOOD, "length": 10**400}, "length", "not a length"),
    ({**GOOD, "length": "3"}, "length", "not a length"),
    ({**GOOD, "transform": [0, 0]}, "transform", "not a transform"),
    ({**GOOD, "transform": [0, math.inf, 0]}, "transform[1]", "not a transform"),
    ({**GOOD, "transform": [0, 0, 1e9]}, "transform[2]", "not a transform"),
    ({**GOOD, "version": 1}, "version", "unknown version"),
    ({**GOOD, "version": "0"}, "version", "unknown version"),
    ({key: value for key, value in GOOD.items() if key != "version"}, "version", "missing"),
    ({key: value for key, value in GOOD.items() if key != "length"}, "length", "missing"),
    ({"version": 0, "length": 3}, "segments", "neither segments nor shape"),
    ({"version": 0, "length": 3, "shape": [1, 1]}, "shape", "not the shape of a grid"),
    ({"version": 0, "length": 3, "shape": [10**6, 10**6]}, "shape", "not the shape of a grid"),
    ({**GOOD, "length": 1e6, "segments": [[0, 0, 2, 0]], "shape": [1, 3]}, "length", "too large a network"),
    ({**GOOD, "note": math.inf}, "note", "not a JSON value"),
    ([1, 2], None, "not a road network"),
]


@pytest.mark.parametrize(("document", "field", "problem"), BAD)
def test_bad_documents_are_refused_by_name(document: Any, field: str | None, problem: str) -> None:
    with pytest.raises(InputError) as caught:
        RoadNetwork.from_document(document, file="a.json")
    assert caught.value.file == "a.json"
    assert caught.value.field == field
    assert problem in str(caught.value)
    assert "expected" in str(caught.value) or problem == "not a JSON value"


BAD_TEXTS = [
    ("", "empty"),
    ("  \n", "empty"),
    ('{"version": 0,', "not JSON"),
    ("[1, 2]", "not a JSON object"),
    ('{"version": 0, "length": NaN, "shape": [2, 2]}', "not a JSON number"),
    ('{"version": 0, "version": 0}', "key given twice"),
    ("[" * 100_000, "nested too deeply"),
    ('{"length": ' + "9" * 5000 + "}", "not JSON"),
    ("version 0\n", "not a line of RND text (line 1)"),
    ("version: 0\nlength: 3\nlength: 4\n", "key given twice (line 3)"),
    ("version: 0\nlength: 3\nsegments: 0 0 0 1\n", "not a line break (line 3)"),
    ("version: 0\nlength: 3\nsegments:\n0 0 0 one\n", "segments[0][3]: not a lattice coordinate"),
    ("version: 0\nlength: 3\nsegments:\n0 0 0\n", "segments[0]: not a segment"),
    ("version: 0\nlength: 3 4\nshape: 2 2\n", "length: not a length"),
    ("version: 0\nlength: nan\nshape: 2 2\n", "length: not a length"),
    ("version: 0\nlength: 1e999\nshape: 2 2\n", "length: not a length"),
    ("version: 0\nlength: 3\nshape: 2 2\ntransform: 0 0\n", "transform: not a transform"),
    ("version: 0\nlength: 1_0\nshape: 2 2\n", "length: not a length"),
    ("\x00\x01\x02", "not a line of RND text"),
]


@pytest.mark.parametrize(("text", "problem"), BAD_TEXTS)
def test_bad_texts_are_refused_by_name(text: str, problem: str) -> None:
    with pytest.raises(InputError) as caught:
        RoadNetwork.from_text(text, file="a.rnd")
    assert caught.value.file == "a.rnd"
    assert problem in str(caught.value)


def test_plain_text_in_any_order_with_comments_and_unknown_keys() -> None:
    text = "# a square\r\nshape: 2 2 # rows, columns\nname: my town\nlength: 2.5\n\nversion: 0\ntransform: 1 -2 .5\n"
    network = RoadNetwork.from_text(text)
    assert network.segments == RoadNetwork.grid(2, 2).segments
    assert network.length == 2.5
    assert network.transform == (1.0, -2.0, 0.5)
    assert network.extra == {"name": "my town"}


def test_defaults_and_whole_numbers_written_as_floats() -> None:
    document = {"version": 0, "length": 3.0, "segments": [[0.0, 0, 1, 0]]}
    network = RoadNetwork.from_document(document)
    assert network.transform == (0.0, 0.0, 0.0)
    assert network.shape == (1, 2)
    assert json.loads(network.to_json()) == {**document, "transform": [0, 0, 0], "shape": [1, 2]}
    assert '"length": 3,' in network.to_json()


@pytest.mark.parametrize("make", ["missing", "folder", "binary", "unreadable"])
def test_files_that_cannot_be_read(make: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.json"
    expected = "no such file"
    if make == "folder":
        path.mkdir()
        expected = "a folder"
    elif make == "binary":
        path.write_bytes(b"\xff\xfe\x00")
        expected = "not UTF-8"
    elif make == "unreadable":
        expected = "no permission to read"
        monkeypatch.setattr(Path, "open", _refuse)
    with pytest.raises(InputError, match=expected) as caught:
        RoadNetwork.read(path)
    assert caught.value.file == str(path)


def _refuse(_: Path, _mode: str) -> bytes:
    raise PermissionError(13, "Permission denied")


def test_standard_input(monkeypatch: pytest.MonkeyPatch) -> None:
    text = RoadNetwork.grid(2, 3).to_text().encode()
    monkeypatch.setattr("sys.stdin", SimpleNamespace(buffer=io.BytesIO(text)))
    assert RoadNetwork.read("-") == RoadNetwork.grid(2, 3)


def test_writing_is_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.json"
    path.write_text("old")

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", fail)
        with pytest.raises(InputError, match="No space left"):
            RoadNetwork.grid(2, 2).write(path, overwrite=True)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]
    RoadNetwork.grid(2, 2).write(path, overwrite=True)
    assert RoadNetwork.read(path) == RoadNetwork.grid(2, 2)
    with pytest.raises(InputError, match="no such folder"):
        RoadNetwork.grid(2, 2).write(tmp_path / "no" / "a.json")
    with pytest.raises(InputError, match="a folder"):
        RoadNetwork.grid(2, 2).write(tmp_path)
