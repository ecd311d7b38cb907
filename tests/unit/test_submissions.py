"""Submissions: what is taken, what is refused before anything is written; stored whole or not at all."""

from __future__ import annotations

import io
import os
import resource
import stat
import zipfile
from collections.abc import Mapping
from pathlib import Path

import pytest

from dubins_traffic.competition.submission import Bounds, check_submission
from dubins_traffic.errors import InputError

CONTROLLER = b"class Controller:\n    pass\n"
PROGRAM = b'program = ["./drive", "--fast"]\n'
ALONE = b'python = "controller.py:Controller"\n'


def archive(files: Mapping[str, bytes], modes: Mapping[str, int] | None = None) -> bytes:
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as file:
        for name, data in files.items():
            entry = zipfile.ZipInfo(name)
            entry.create_system = 3
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = (modes or {}).get(name, stat.S_IFREG | 0o644) << 16
            file.writestr(entry, data)
    return made.getvalue()


def stored(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def put(folder: Path, files: Mapping[str, bytes]) -> Path:
    for name, data in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    return folder


def test_a_file_a_folder_and_an_archive_of_the_same_are_the_same(tmp_path: Path) -> None:
    files = {"controller.py": CONTROLLER, "data/map.bin": bytes(range(256))}
    folder = put(tmp_path / "entry", {**files, "__pycache__/x.pyc": b"1", ".git/config": b"2"})
    store = tmp_path / "store"
    found = check_submission(folder, store)
    assert found.kind == "python"
    assert found.path == store / found.digest
    assert stored(found.path) == {**files, "controller.toml": ALONE}
    (tmp_path / "entry.zip").write_bytes(archive(files))
    assert check_submission(tmp_path / "entry.zip", store) == found
    assert check_submission(archive({f"entry-main/{name}": data for name, data in files.items()}), store) == found
    assert [path.name for path in store.iterdir()] == [found.digest]
    alone = check_submission(folder / "controller.py", store)
    assert stored(alone.path) == {"controller.py": CONTROLLER, "controller.toml": ALONE}
    assert check_submission(CONTROLLER, store) == alone


def test_programs_are_told_by_their_manifest_or_their_first_bytes(tmp_path: Path) -> None:
    found = check_submission(archive({"drive": b"#!/bin/sh\n", "controller.toml": PROGRAM}), tmp_path)
    assert found.kind == "program"
    assert os.access(found.path / "drive", os.X_OK)
    assert not os.access(found.path / "controller.toml", os.X_OK)
    script = check_submission(b"#!/usr/bin/python3\n", tmp_path)
    assert (script.path / "controller.toml").read_bytes() == b'program = ["./program"]\n'
    assert os.access(script.path / "program", os.X_OK)
    own = b'python = "pkg/mine.py:Mine"\n'
    package = check_submission(archive({"pkg/mine.py": CONTROLLER, "controller.toml": own}), tmp_path)
    assert package.kind == "python"


BAD_NAMES = [
    "../controller.py",
    "a/../../x",
    "/etc/passwd",
    "a//b",
    "./x",
    "a\\b",
    "C:x",
    "a\nb",
    "a\x1b[31m",
    "e\u0301",
    "x" * 201,
    "/".join("a" * 20),
    "\u202egpj.py",
]


@pytest.mark.parametrize("name", BAD_NAMES)
def test_names_that_lead_elsewhere_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="name"):
        check_submission(archive({"controller.py": CONTROLLER, name: b"x"}), tmp_path / "store")
    assert not (tmp_path / "store").exists()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", [stat.S_IFLNK, stat.S_IFCHR, stat.S_IFBLK, stat.S_IFIFO, stat.S_IFSOCK])
def test_what_is_no_file_is_refused_in_an_archive(tmp_path: Path, kind: int) -> None:
    data = archive({"controller.py": CONTROLLER, "x": b"/etc/passwd"}, {"x": kind | 0o777})
    with pytest.raises(InputError, match=r"link|device|pipe|socket"):
        check_submission(data, tmp_path / "store")


def test_what_is_no_file_is_refused_in_a_folder(tmp_path: Path) -> None:
    folder = put(tmp_path / "entry", {"controller.py": CONTROLLER})
    (folder / "link").symlink_to("/etc/passwd")
    with pytest.raises(InputError, match="a link"):
        check_submission(folder, tmp_path / "store")
    (folder / "link").unlink()
    os.mkfifo(folder / "pipe")
    with pytest.raises(InputError, match="a pipe"):
        check_submission(folder, tmp_path / "store")


def test_bombs_are_refused_by_what_they_declare(tmp_path: Path) -> None:
    bounds = Bounds(upload=1 << 20, total=1 << 20, files=10)
    zeros = archive({"controller.py": CONTROLLER, "zeros": bytes(2 << 20)})
    assert len(zeros) < 10_000
    with pytest.raises(InputError, match="unpacks to too much"):
        check_submission(zeros, tmp_path / "store", bounds)
    many = archive({"controller.py": CONTROLLER, **{f"f{k}": b"" for k in range(10)}})
    with pytest.raises(InputError, match="too many files"):
        check_submission(many, tmp_path / "store", bounds)
    most = archive({f"f{k}": b"" for k in range(100)})
    with pytest.raises(InputError, match="too many entries"):
        check_submission(most, tmp_path / "store", bounds)
    with pytest.raises(InputError, match="too large"):
        check_submission(bytes(2 << 20), tmp_path / "store", bounds)
    folder = put(tmp_path / "entry", {"controller.py": CONTROLLER, "zeros": bytes(2 << 20)})
    with pytest.raises(InputError, match="too much"):
        check_submission(folder, tmp_path / "store", bounds)


def test_an_archive_that_declares_less_than_it_holds_is_refused(tmp_path: Path) -> None:
    data = archive({"controller.py": CONTROLLER, "zeros": bytes(1 << 20)})
    size = (1 << 20).to_bytes(4, "little")
    assert data.count(size) == 2
    with pytest.raises(InputError, match="damaged"):
        check_submission(data.replace(size, (100).to_bytes(4, "little")), tmp_path / "store")


def test_damaged_and_unusual_archives_are_refused(tmp_path: Path) -> None:
    data = archive({"controller.py": CONTROLLER * 100})
    for cut in range(4, len(data), 7):
        with pytest.raises(InputError):
            check_submission(data[:cut], tmp_path / "store")
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_LZMA) as file:
        file.writestr("controller.py", CONTROLLER)
    with pytest.raises(InputError, match="unusual"):
        check_submission(made.getvalue(), tmp_path / "store")
    locked = bytearray(archive({"controller.py": CONTROLLER}))
    for magic, place in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        locked[locked.index(magic) + place] |= 1
    with pytest.raises(InputError, match="encrypted"):
        check_submission(bytes(locked), tmp_path / "store")
    assert not (tmp_path / "store").exists()


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({"readme.md": b""}, "nothing to run"),
        ({"controller.py": b"x = 1"}, "no class Controller"),
        ({"controller.py": b"\xff Controller"}, "not UTF-8"),
        ({"controller.py": b"Controller\0"}, "not text"),
        ({"controller.toml": b"program = ["}, "not TOML"),
        ({"controller.toml": b"a = " + b"[" * 9000}, "not TOML"),
        ({"controller.toml": b""}, "one of python, program and image"),
        ({"controller.toml": b'program = ["a"]\npython = "a.py:A"'}, "one of python, program and image"),
        ({"controller.toml": b'python = "a.py:A"'}, "no such file"),
        ({"controller.toml": b'python = "../a.py:A"', "a.py": b""}, "no such file"),
        ({"controller.toml": b"program = [1]"}, "a text"),
        ({"controller.toml": PROGRAM + b"limits = 3"}, "unknown key"),
        ({"controller.toml": b'program = ["./drive"]'}, "no such file"),
        ({"controller.toml": b'program = ["/bin/sh"]'}, "no such file"),
        ({"controller.py": CONTROLLER, "CONTROLLER.py": b""}, "by case alone"),
        ({"controller.py": CONTROLLER, "a": b"", "a/b": b""}, "a folder that is a file"),
    ],
)
def test_what_is_wrong_is_named_and_nothing_is_stored(tmp_path: Path, files: Mapping[str, bytes], message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        check_submission(archive(files), tmp_path / "store")
    assert error.value.file == "upload"
    assert not (tmp_path / "store").exists()


def test_what_can_not_be_written_whole_leaves_nothing(tmp_path: Path) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        with pytest.raises(InputError, match="can't be stored") as error:
            check_submission(archive({"a": b"", "controller.py": CONTROLLER * 100}), tmp_path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert list(tmp_path.iterdir()) == []
    assert isinstance(error.value.__cause__, OSError)
