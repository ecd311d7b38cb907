"""Libraries of machine code: loaded without a compiler, of the sources that run, from folders of one's own."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import dubins_traffic
from dubins_traffic.compiling import linking
from dubins_traffic.errors import InputError
from dubins_traffic.kernels import levels
from dubins_traffic.kernels.folders import is_private
from dubins_traffic.kernels.levels import LEVELS
from dubins_traffic.kernels.trig import sincos

pytestmark = pytest.mark.skipif(not levels.levels(), reason="libraries are for Linux on x86-64")

LINKED = pytest.mark.tools("linkers")
"""The mark of tests that link a library."""
ASKED = """
import sys
from dubins_traffic.compiling import beside
from dubins_traffic.kernels.trig import sincos
beside.can_build = lambda: False
print(sincos(0.5), sincos.is_quick, "llvmlite" in sys.modules)
"""
"""Calls a kernel where there is no Numba."""
QUICK = f"{sincos.interpreted(0.5)} True False\n"
SLOW = f"{sincos.interpreted(0.5)} False False\n"
LINK = """
import sys
from pathlib import Path
from dubins_traffic.compiling import linking, loading, store
from dubins_traffic.kernels.kinds import kind_of
from dubins_traffic.kernels.levels import level
from dubins_traffic.kernels.trig import sincos
sincos(0.5)
key = sincos.key((kind_of(0.5),))
print(linking.link({key: store.kernel_file(key, loading.target())}, level(), Path(sys.argv[1])))
"""


def python(cache: Path, code: str, *words: str, **variables: str) -> tuple[str, str]:
    around = {**os.environ, "NUMBA_CACHE_DIR": str(cache), "DUBINS_TRAFFIC_KERNELS": "auto", **variables}
    ran = subprocess.run([sys.executable, "-c", code, *words], env=around, check=True, capture_output=True, text=True)
    return ran.stdout, ran.stderr


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """Return a folder with a library of one kernel, beside whatever the builder has left."""
    cache = tmp_path_factory.mktemp("made")
    python(cache, LINK, str(cache / "library"), DUBINS_TRAFFIC_KERNELS="compiled")
    return cache


@pytest.fixture
def cache(made, tmp_path) -> Path:
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    return tmp_path


@LINKED
def test_a_library_is_called_without_a_compiler(cache) -> None:
    assert python(cache, ASKED) == (QUICK, "")


def test_without_library_and_compiler_kernels_run_interpreted_and_one_line_says_so(tmp_path) -> None:
    told, said = python(tmp_path, ASKED)
    assert told == SLOW
    assert said.count("\n") == 1
    assert "dubins-traffic[compile]" in said


@LINKED
def test_of_a_library_of_other_sources_nothing_is_called(cache, tmp_path) -> None:
    package = Path(dubins_traffic.__file__).parent
    shutil.copytree(package, tmp_path / "src" / package.name, ignore=shutil.ignore_patterns("__pycache__"))
    source = tmp_path / "src" / package.name / "kernels" / "angles.py"
    source.write_text(source.read_text() + "\nMORE = 1\n")
    assert python(cache, ASKED, PYTHONPATH=str(tmp_path / "src"))[0] == SLOW


@LINKED
@pytest.mark.parametrize("harm", ["other bytes", "no library", "no manifest in JSON"])
def test_a_damaged_library_is_left_alone_and_said(cache, harm) -> None:
    (library,) = (cache / "library").glob("*.so")
    (manifest,) = (cache / "library").glob("*.json")
    if harm == "other bytes":
        library.write_bytes(library.read_bytes()[:-1] + b"x")
    elif harm == "no library":
        library.unlink()
    else:
        manifest.write_text("{")
    told, said = python(cache, ASKED)
    assert told == SLOW
    assert "can't be used" in said


@LINKED
@pytest.mark.parametrize("mode", [0o775, 0o757])
def test_a_folder_that_others_can_write_is_not_loaded_from_but_by_boxes(cache, mode) -> None:
    (cache / "library").chmod(mode)
    assert not is_private(cache / "library")
    assert python(cache, ASKED)[0] == SLOW
    assert python(cache, ASKED, DUBINS_TRAFFIC_KERNELS="kept") == (QUICK, "")


def test_whose_folders_above_are_open_to_all_is_not_private(tmp_path) -> None:
    (tmp_path / "open" / "below").mkdir(parents=True)
    assert is_private(tmp_path / "open" / "below")
    (tmp_path / "open").chmod(0o777)
    assert not is_private(tmp_path / "open" / "below")
    (tmp_path / "open").chmod(0o1777)
    assert is_private(tmp_path / "open" / "below")
    assert not is_private(tmp_path / "gone")


@LINKED
def test_the_manifest_says_what_the_library_was_built_of_and_an_older_library_goes(cache) -> None:
    (manifest,) = (cache / "library").glob("*.json")
    told = json.loads(manifest.read_text())
    assert (told["level"], told["file"]) == (levels.level(), next((cache / "library").glob("*.so")).name)
    assert [own["kernel"].partition("-")[0] for own in told["kernels"].values()] == ["kernels.angles"]
    (cache / "library" / f"{told['level']}-older.so").write_bytes(b"")
    python(cache, LINK, str(cache / "library"), DUBINS_TRAFFIC_KERNELS="compiled")
    assert [path.name for path in (cache / "library").glob("*.so")] == [told["file"]]
    assert sorted(path.suffix for path in (cache / "library").iterdir()) == [".json", ".so"]


@LINKED
def test_no_library_has_fused_operations_or_needs_another(made) -> None:
    (library,) = (made / "library").glob("*.so")
    if shutil.which("readelf") is None:
        pytest.skip("no readelf here")
    told = subprocess.run(["readelf", "-d", library], check=True, capture_output=True, text=True).stdout
    assert "NEEDED" not in told
    assert "TEXTREL" not in told


def test_a_lower_level_that_the_environment_names_is_taken(monkeypatch) -> None:
    try:
        for name in LEVELS:
            levels.levels.cache_clear()
            monkeypatch.setenv(levels.LEVEL, name)
            assert levels.level() == name
            assert all(LEVELS.index(own) <= LEVELS.index(name) for own in levels.levels())
        levels.levels.cache_clear()
        monkeypatch.setenv(levels.LEVEL, "x86-64-v5")
        with pytest.raises(InputError, match=r"DUBINS_TRAFFIC_LEVEL: .*'x86-64-v5'.*x86-64-v2"):
            levels.levels()
    finally:
        levels.levels.cache_clear()


@pytest.mark.parametrize(
    ("lacking", "best"),
    [("", "x86-64-v4"), ("x86-64-v4", "x86-64-v3"), ("x86-64-v3", "x86-64-v2"), ("x86-64-v2", "")],
)
def test_levels_are_those_of_the_processor(tmp_path, monkeypatch, lacking, best) -> None:
    """It has a level if it can do all that the level adds, and those below."""
    features = [
        name for level, own in levels.FEATURES.items() for name in own.split()[: -1 if level == lacking else None]
    ]
    (tmp_path / "told").write_text(f"processor : 0\nflags\t\t: fpu {' '.join(features)}\nbugs :\n")
    monkeypatch.setattr(levels, "TOLD", tmp_path / "told")
    assert (levels._machines() or ("",))[0] == best
    monkeypatch.setattr(levels, "TOLD", tmp_path / "gone")
    assert levels._machines() == ()


def test_without_a_linker_it_is_said_how_to_get_one(monkeypatch) -> None:
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(linking.shutil, "which", lambda _name: None)
    monkeypatch.setattr(linking, "find_spec", lambda _name: None)
    with pytest.raises(InputError, match=r"no linker.*ziglang"):
        linking.linker()
    monkeypatch.setattr(linking, "find_spec", lambda _name: object())
    assert linking.linker()[1:] == ["-m", "ziglang", "cc"]
    monkeypatch.setenv("CC", "mine -m64")
    assert linking.linker() == ["mine", "-m64"]


@LINKED
@pytest.mark.parametrize("linker", ["false", "/gone/cc"])
def test_a_linker_that_fails_leaves_the_library_as_it_was(cache, linker) -> None:
    before = {path.name: path.read_bytes() for path in (cache / "library").iterdir()}
    with pytest.raises(subprocess.CalledProcessError) as failed:
        python(cache, LINK, str(cache / "library"), DUBINS_TRAFFIC_KERNELS="compiled", CC=linker)
    assert "CC: the linker" in failed.value.stderr
    assert {path.name: path.read_bytes() for path in (cache / "library").iterdir()} == before
