"""Whatever is handed in, it is stored as it is or refused with a reason; nothing is written elsewhere."""

from __future__ import annotations

import io
import tempfile
import warnings
import zipfile
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st

from dubins_traffic.competition.submission import Bounds, check_submission, content_digest, folder_files
from dubins_traffic.errors import InputError

BOUNDS = Bounds(upload=1 << 16, total=1 << 16, files=8)
CONTROLLER = b"class Controller: ...\n"
parts = st.sampled_from(
    ["a", "b", "..", ".", "", "A", "controller.py", "controller.toml", "x\\y", "\n", "c:", "\u00e9"]
)
names = st.lists(parts, min_size=1, max_size=4).map("/".join)
entries = st.lists(
    st.tuples(names, st.sampled_from([b"", CONTROLLER, b'python = "controller.py:A"\n', bytes(9000)])),
    max_size=10,
)


def archive(files: list[tuple[str, bytes]], modes: list[int]) -> bytearray:
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as file:
        for (name, data), mode in zip(files, modes, strict=False):
            entry = zipfile.ZipInfo(name)
            entry.filename = name
            entry.external_attr = mode << 16
            with warnings.catch_warnings(action="ignore"):  # that a name stands twice
                file.writestr(entry, data, zipfile.ZIP_DEFLATED)
    return bytearray(made.getvalue())


def hand_in(data: bytes) -> None:
    """Hand something in, and see that all that is written is one whole submission in the store."""
    with tempfile.TemporaryDirectory() as folder:
        store = Path(folder) / "deep" / "store"
        try:
            found = check_submission(data, store, BOUNDS)
        except InputError:
            assert not store.exists() or list(store.iterdir()) == []
        else:
            assert content_digest(folder_files(found.path, BOUNDS)) == found.digest
            assert list(store.iterdir()) == [found.path]
            held = [path for path in found.path.rglob("*") if path.is_file()]
            assert len(held) <= BOUNDS.files + 1
            assert sum(path.stat().st_size for path in held) <= BOUNDS.total + 100
        outside = [path for path in Path(folder).rglob("*") if not path.is_relative_to(store)]
        assert outside in ([], [store.parent])


@settings(deadline=None, derandomize=True)
@given(entries, st.lists(st.sampled_from([0, 0o100644, 0o120777, 0o020644, 0o040755]), min_size=10, max_size=10))
def test_archives_of_any_names_and_kinds(files: list[tuple[str, bytes]], modes: list[int]) -> None:
    hand_in(bytes(archive(files, modes)))


@settings(deadline=None, derandomize=True)
@given(st.data())
def test_archives_with_bytes_changed(data: st.DataObject) -> None:
    made = archive([("controller.py", CONTROLLER * 20), ("d/x", bytes(500))], [0o100644] * 2)
    for _ in range(data.draw(st.integers(1, 6))):
        made[data.draw(st.integers(0, len(made) - 1))] = data.draw(st.integers(0, 255))
    hand_in(bytes(made))


@settings(deadline=None, derandomize=True)
@given(st.binary(max_size=400), st.sampled_from([b"", b"PK\x03\x04", b"#!", b"\x7fELF", CONTROLLER]))
def test_bytes(data: bytes, first: bytes) -> None:
    hand_in(first + data)
