"""Compiled kernels on disk: shared by all copies of the same sources, checked before use."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from dubins_traffic.compiling.store import SUFFIX, kernel_file, load, save
from dubins_traffic.kernels.sources import KEEPERS, MAKERS, PACKAGE, imported, key_of

CALL = "from dubins_traffic.kernels.trig import sincos; print(sincos(0.5))"


def call(cache: Path, source: Path | None = None) -> subprocess.CompletedProcess[str]:
    variables = os.environ | {"NUMBA_CACHE_DIR": str(cache)}
    if source is not None:
        variables["PYTHONPATH"] = str(source)
    command = [sys.executable, "-W", "error", "-c", CALL]
    return subprocess.run(command, env=variables, check=True, capture_output=True, text=True)


def kernels(folder: Path) -> list[Path]:
    return sorted(folder.rglob(f"*{SUFFIX}"))


def test_the_same_sources_elsewhere_compile_nothing(tmp_path) -> None:
    import dubins_traffic

    first = call(tmp_path / "cache")
    before = {path: path.stat().st_mtime_ns for path in kernels(tmp_path / "cache")}
    assert before
    package = Path(dubins_traffic.__file__).parent
    shutil.copytree(package, tmp_path / "copy" / package.name, ignore=shutil.ignore_patterns("__pycache__"))
    second = call(tmp_path / "cache", tmp_path / "copy")
    assert second.stdout == first.stdout
    assert {path: path.stat().st_mtime_ns for path in kernels(tmp_path / "cache")} == before


@pytest.mark.parametrize(
    "damage",
    [
        lambda data: data[: len(data) // 2],
        lambda _data: b"",
        lambda data: data[:40] + bytes([data[40] ^ 1]) + data[41:],
        lambda data: bytes(255 - byte for byte in data),
        lambda data: data + b"\0",
    ],
    ids=["cut", "empty", "one bit", "noise", "longer"],
)
def test_a_damaged_kernel_is_compiled_again_with_one_line(tmp_path, damage) -> None:
    first = call(tmp_path)
    files = {path: path.read_bytes() for path in kernels(tmp_path)}
    for path, data in files.items():
        path.write_bytes(damage(data))
    again = call(tmp_path)
    assert again.stdout == first.stdout
    lines = again.stderr.splitlines()
    assert 1 <= len(lines) <= len(files)
    assert all("is damaged; it is compiled again" in line for line in lines)
    assert call(tmp_path).stderr == ""


def test_what_is_saved_is_found_by_its_path_alone(tmp_path) -> None:
    answer = ("tuple", (("number", "f8"), ("none",)))
    save(tmp_path / "below" / "a.kernel", answer, b"code\nof one")
    save(tmp_path / "below" / "b.kernel", answer, b"")
    assert load(tmp_path / "below" / "a.kernel") == (answer, b"code\nof one")
    assert load(tmp_path / "below" / "b.kernel") == (answer, b"")
    assert load(tmp_path / "below" / "c.kernel") is None
    assert len(list((tmp_path / "below").iterdir())) == 2


def test_a_file_that_cannot_be_written_leaves_nothing(tmp_path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(OSError, match="file"):
        save(tmp_path / "file" / "below" / "a.kernel", ("none",), b"")
    assert len(list(tmp_path.iterdir())) == 1


def test_kinds_and_processor_name_a_kernels_file() -> None:
    file = PACKAGE / "kernels" / "trig.py"
    paths = {
        kernel_file(key_of(file, name, kinds), processor)
        for name in ("a", "b")
        for kinds in ((), (("number", "f8"),), (("number", "i8"),))
        for processor in (("x86", "one"), ("x86", "two"))
    }
    assert len(paths) == 12
    assert len({path.parent for path in paths}) == 1


def test_how_kernels_are_kept_is_no_part_of_what_they_are() -> None:
    for file in PACKAGE.rglob("*.py"):
        if b"\n@jit" in file.read_bytes():
            assert not imported(file) & KEEPERS
    for file in (PACKAGE / "kernels").glob("*.py"):
        text = file.read_text()
        assert "@jit" in text or "jit(" in text or file in KEEPERS | MAKERS or "kernels.compile" not in text
