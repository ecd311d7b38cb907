"""The first run on a machine, with an empty cache of kernels: the same bytes as any other, and nobody left behind."""

import os
import signal
import subprocess
import sys

from dubins_traffic.kernels import compile
from dubins_traffic.runs import precompile as warm


def run(folder, record_folder):
    arguments = ["run", "mc-small-4grid-agents2", "--seed", "3", "--records", str(record_folder)]
    subprocess.run(
        [sys.executable, "-m", "dubins_traffic.cli", *arguments],
        env={**os.environ, "NUMBA_CACHE_DIR": str(folder)},
        check=True,
        stdout=subprocess.DEVNULL,
    )
    return (record_folder / "trial-0000.mcap").read_bytes()


def test_a_first_run_gives_the_bytes_of_later_ones(tmp_path) -> None:
    first = run(tmp_path / "cache", tmp_path / "first")
    kernels = len(list((tmp_path / "cache").rglob("*.kernel")))
    assert kernels > 50
    assert run(tmp_path / "cache", tmp_path / "second") == first
    assert len(list((tmp_path / "cache").rglob("*.kernel"))) == kernels
    assert not list((tmp_path / "cache").rglob("*.tmp*"))


COMPANION = """
from dubins_traffic.runs.precompile import companion
with companion() as process:
    process.wait()
with companion() as second:
    print(process.returncode, second)
"""


def test_a_companion_works_only_where_nothing_is_compiled(tmp_path) -> None:
    variables = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    ran = subprocess.run(
        [sys.executable, "-c", COMPANION], env=variables, check=True, capture_output=True, text=True
    )
    assert ran.stdout == "0 None\n"
    assert len(list(tmp_path.rglob("*.kernel"))) > 50


def test_a_companion_is_ended_with_the_first_run(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(compile, "cache_folder", lambda: tmp_path)
    with warm.companion() as process:
        assert process is not None
        assert process.poll() is None
    assert process.poll() == -signal.SIGTERM


def test_a_cache_that_cannot_be_looked_into_asks_for_no_companion(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(compile, "cache_folder", lambda: tmp_path / "missing")
    assert not compile.nothing_compiled()
