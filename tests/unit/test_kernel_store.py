"""Compiled kernels on disk: shared by all copies of the same sources, checked before use."""

import os
import shutil
import subprocess
import sys
import types
from pathlib import Path

import pytest

from dubins_traffic.kernels.sources import PACKAGE, imported, kernel_files
from dubins_traffic.kernels.store import SUFFIX, KernelFiles

CALL = "from dubins_traffic.kernels.trig import sincos; print(sincos(0.5), len(sincos.stats.cache_hits))"


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
    assert first.stdout.endswith(" 0\n")
    before = {path: path.stat().st_mtime_ns for path in kernels(tmp_path / "cache")}
    assert before
    package = Path(dubins_traffic.__file__).parent
    shutil.copytree(package, tmp_path / "copy" / package.name, ignore=shutil.ignore_patterns("__pycache__"))
    second = call(tmp_path / "cache", tmp_path / "copy")
    assert second.stdout.endswith(" 1\n")
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


def test_a_folder_that_cannot_be_written_is_no_error(tmp_path, capsys) -> None:
    (tmp_path / "file").write_text("in the way")
    files = KernelFiles(tmp_path / "file" / "below", "some.kernel")
    files.save("key", [1, 2])
    files.save("other", [1, 2])
    assert files.load("key") is None
    assert capsys.readouterr().err.count("cannot be kept") == 1


def test_what_is_saved_is_found_by_its_key_alone(tmp_path) -> None:
    files = KernelFiles(tmp_path, "some.kernel")
    files.save(("a", 1), [1])
    files.save(("a", 2), [2])
    assert files.load(("a", 1)) == [1]
    assert files.load(("a", 2)) == [2]
    assert files.load(("a", 3)) is None
    files.flush()
    assert files.load(("a", 1)) is None
    assert not list(tmp_path.iterdir())


def test_how_kernels_are_put_together_decides_what_is_compiled() -> None:
    for file in kernel_files():
        assert PACKAGE / "kernels" / "linking.py" in imported(file)


def test_a_kernel_saved_for_a_type_that_is_defined_elsewhere_now_is_not_found(tmp_path, monkeypatch) -> None:
    module = types.ModuleType("streams_of_old")
    module.Stream = type("Stream", (), {"__module__": module.__name__, "__repr__": lambda _self: "Stream"})
    monkeypatch.setitem(sys.modules, module.__name__, module)
    files = KernelFiles(tmp_path, "drawn")
    files.save(module.Stream(), "compiled")
    monkeypatch.delitem(sys.modules, module.__name__)
    assert files.load(module.Stream()) is None
