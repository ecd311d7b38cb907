"""The first run on a machine, with an empty cache of kernels: at once, and the same bytes as any other."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.builders import builders, hurry

COMMAND = [sys.executable, "-m", "dubins_traffic.cli"]
RUN = ["run", "mc-small-4grid-agents2", "--controller", "simple", "--seed", "3"]
BESIDE = "compiled in the background"


def run(cache: Path, records: Path, tier: str, arguments=RUN) -> tuple[bytes, str]:
    ran = subprocess.run(
        [*COMMAND, *arguments, "--records", str(records)],
        env={**os.environ, "NUMBA_CACHE_DIR": str(cache), "DUBINS_TRAFFIC_KERNELS": tier},
        check=True,
        capture_output=True,
        text=True,
    )
    return (records / "trial-0000.mcap").read_bytes(), ran.stderr


def kernels(cache: Path) -> set[str]:
    return {path.name for path in cache.rglob("*.kernel")}


@pytest.fixture(scope="module")
def first(tmp_path_factory) -> tuple[Path, bytes, str]:
    """Return a cache that a first run has begun, what it recorded, and what it said."""
    cache = tmp_path_factory.mktemp("first") / "cache"
    return cache, *run(cache, cache.parent / "records", "auto")


def test_a_first_run_is_interpreted_and_says_so_in_one_line(first) -> None:
    cache, _, said = first
    assert said.count("dubins-traffic: ") == said.count(BESIDE) == 1
    assert builders(cache) or kernels(cache)


def test_later_runs_give_the_same_bytes_and_compile_nothing(first, tmp_path) -> None:
    cache, recorded, _ = first
    hurry(cache)
    assert run(cache, tmp_path / "waiting", "compiled")[0] == recorded
    made = kernels(cache)
    assert len(made) >= 6
    for tier in ("auto", "compiled", "interpreted"):
        again, said = run(cache, tmp_path / tier, tier)
        assert again == recorded
        assert "dubins-traffic: " not in said
    assert kernels(cache) == made
    assert not list(cache.rglob("*.failed"))
    assert not list(cache.rglob("*.tmp*"))
