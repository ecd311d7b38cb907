"""A campaign on a real Ray cluster of several nodes: what is killed is run again, and nothing is counted twice."""

from __future__ import annotations

import os
import signal
import subprocess
import threading
import time
from pathlib import Path

import pytest
from pyarrow import parquet

from dubins_traffic.campaign import ray_crew, ray_driver
from dubins_traffic.cli.main import main
from tests import ray_cluster
from tests.campaigns import campaign, command, logged, run, succeed, written

pytestmark = pytest.mark.tools


DOCUMENT = campaign(controllers=["controllers.py:Slow", "simple"], trials=12)
TRIALS = 2 * 4 * 12
BOUND = 600.0
"""Seconds within which the trials of a cluster must have begun, and its loss be noticed."""
SILENCE = 5.0
"""Seconds after which a silent cluster counts as lost here."""
WIDE = ("--workers", "3")
"""`Slow` sleeps most of the time."""


def wait_for(folder: Path, trials: int, process: subprocess.Popen[str] | None = None) -> None:
    """Wait until `Slow` has begun so many trials."""
    begun = time.monotonic()
    while logged(folder) < trials:
        assert time.monotonic() - begun < BOUND
        assert process is None or process.poll() is None
        time.sleep(0.02)


def test_workers_nodes_and_the_head_are_killed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    plain, many, lost = (tmp_path / name for name in ("plain", "many", "lost"))
    for folder in (plain, many, lost):
        folder.mkdir()
    with (
        subprocess.Popen(command(written(plain, DOCUMENT), plain / "out", *WIDE)) as alone,
        ray_cluster.running() as cluster,
    ):
        assert alone.wait(timeout=600) == 0
        table = (plain / "out" / "results.parquet").read_bytes()
        ray = ("--ray", cluster.address)
        file = written(many, DOCUMENT)
        with subprocess.Popen(command(file, many / "out", *ray), stdout=subprocess.PIPE, text=True) as process:
            wait_for(many, 10, process)
            os.kill(int((many / "log").read_text().split()[-1]), signal.SIGKILL)
            wait_for(many, 30, process)
            cluster.kill_node()
            told, _ = process.communicate(timeout=600)
        assert process.returncode == 0
        assert told == f"{many / 'out' / 'results.parquet'}: {TRIALS} trials\n"
        assert (many / "out" / "results.parquet").read_bytes() == table
        assert len(set((many / "log").read_text().split())) >= ray_cluster.NODES

        file = written(lost, DOCUMENT)
        monkeypatch.setattr(ray_crew, "SILENCE", SILENCE)
        killed: list[float] = []

        def kill() -> None:
            wait_for(lost, 20)
            cluster.kill_head()
            killed.append(time.monotonic())

        killer = threading.Thread(target=kill)
        killer.start()
        assert main(command(file, lost / "out", *ray)[1:]) == 1
        killer.join()
        assert time.monotonic() - killed[0] < SILENCE + BOUND
        told = capsys.readouterr().err
        assert f"the Ray cluster at {cluster.address} is lost" in told
        assert f"of {TRIALS} trials are kept, --resume goes on" in told
    kept, begun = finished(lost / "out"), logged(lost)
    assert kept < TRIALS
    assert succeed(file, lost / "out", "--resume", *WIDE) == table
    assert logged(lost) - begun <= TRIALS - kept


def test_a_lost_head_is_told_within_half_a_minute() -> None:
    assert ray_crew.SILENCE + ray_driver.PULSE < 30.0


def finished(out: Path) -> int:
    return sum(parquet.read_metadata(part).num_rows for part in (out / "parts").glob("[0-9]*.parquet"))


def test_a_cluster_of_its_own_ends_with_the_campaign(tmp_path: Path) -> None:
    small = campaign(controllers=["controllers.py:Faulty", "simple"], trials=5, factors={"duration": [1.0]}, seed=0)
    one, two = tmp_path / "one", tmp_path / "two"
    one.mkdir()
    two.mkdir()
    first = run(written(one, small), one / "out")
    second = run(written(two, small), two / "out", "--ray", "local", "--workers", "2")
    assert first.returncode == second.returncode == 1
    assert "crashed" in parquet.read_table(one / "out" / "results.parquet")["end"].to_pylist()
    assert (one / "out" / "results.parquet").read_bytes() == (two / "out" / "results.parquet").read_bytes()
