"""The first run on a machine, with an empty cache of kernels: the same bytes as any other, and nobody left behind."""

import os
import subprocess
import sys

from dubins_traffic.campaign import warm


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
    kernels = len(list((tmp_path / "cache").rglob("*.nbi")))
    assert kernels > 50
    assert run(tmp_path / "cache", tmp_path / "second") == first
    assert len(list((tmp_path / "cache").rglob("*.nbi"))) == kernels
    assert not list((tmp_path / "cache").rglob("*.tmp*"))


def test_a_companion_works_only_where_nothing_is_compiled() -> None:
    warm.compile_motion_and_agents()
    assert not warm.nothing_compiled()
