"""A campaign on the command line: the same table however it is run, whatever happens on the way."""

from __future__ import annotations

import os
import random
import re
import resource
import signal
import subprocess
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from pyarrow import parquet

from tests.campaigns import campaign, command, logged, run, succeed, written
from tests.disks import small_disk

TRIALS = 2 * 4 * 8


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The bytes of the small campaign's table, run by one worker without an interruption."""
    folder = tmp_path_factory.mktemp("plain")
    data = succeed(written(folder, campaign()), folder / "out", "--workers", "1")
    assert logged(folder) == TRIALS // 2
    return data


def kept(folder: Path) -> int:
    """Return how many trials have their rows in parts."""
    names = [path.stem.split("-") for path in (folder / "parts").glob("[0-9]*.parquet")]
    return sum(int(last) - int(first) + 1 for first, last in names)


@pytest.mark.path
def test_the_number_of_workers_does_not_show(tmp_path: Path, table: bytes) -> None:
    assert succeed(written(tmp_path, campaign()), tmp_path / "out", "--workers", "2") == table


def test_controllers_are_compared_on_the_same_instances(tmp_path: Path, table: bytes) -> None:
    (tmp_path / "results.parquet").write_bytes(table)
    rows = parquet.read_table(tmp_path / "results.parquet").to_pylist()
    assert [row["number"] for row in rows] == list(range(TRIALS))
    drawn: dict[str, list[Any]] = {}
    for row in rows:
        drawn.setdefault(row["controller"], []).append((row["cell"], row["trial"], row["seed"]))
    assert drawn["controllers.py:Logged"] == drawn["simple"]
    assert len({row["seed"] for row in rows}) == 4
    assert Counter((row["factor.e_agents"], row["factor.duration"]) for row in rows) == {
        (n, seconds): 16 for n in (0, 2) for seconds in (1.0, 2.0)
    }
    assert {(row["factor.duration"], row["duration_s"]) for row in rows} == {(1.0, 1.0), (2.0, 2.0)}


def await_group(group: int) -> None:
    """Wait until the workers of a process that was killed have noticed."""
    until = time.monotonic() + 600
    with suppress(ProcessLookupError):
        while True:
            os.killpg(group, 0)
            assert time.monotonic() < until
            time.sleep(0.05)


def test_ten_kills_lose_and_repeat_nothing_that_was_finished(tmp_path: Path, table: bytes) -> None:
    file, out = written(tmp_path, campaign()), tmp_path / "out"
    out.mkdir()  # what is gone on with must be there, and the first kill may come before it is made
    chance = random.Random(2016)
    finished = 0
    for _ in range(10):
        quiet = subprocess.DEVNULL
        own = command(file, out, "--resume", "--workers", "1")
        with subprocess.Popen(own, stderr=quiet, start_new_session=True) as process:
            with suppress(subprocess.TimeoutExpired):
                process.wait(chance.uniform(0.5, 3.5))
            process.kill()
        await_group(process.pid)
        before, finished = finished, kept(out) if not (out / "results.parquet").exists() else TRIALS
        assert finished >= before
    begun = logged(tmp_path)
    assert succeed(file, out, "--resume", "--workers", "2") == table
    assert logged(tmp_path) - begun <= (TRIALS - finished)
    again = logged(tmp_path)
    assert succeed(file, out, "--resume") == table
    assert logged(tmp_path) == again


def test_ctrl_c_keeps_what_is_finished(tmp_path: Path, table: bytes) -> None:
    slow = campaign(controllers=["controllers.py:Slow", "simple"])
    file, out = written(tmp_path, slow), tmp_path / "out"
    with subprocess.Popen(
        command(file, out, "--workers", "2"), stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        assert process.stderr is not None
        while kept(out) < 6 and process.poll() is None:
            time.sleep(0.02)
        os.killpg(process.pid, signal.SIGINT)
        told = process.stderr.read()
        status = process.wait(timeout=600)
    finished = kept(out)
    assert status == 1
    said = re.search(rf"(\d+) of {TRIALS} trials are kept, --resume goes on", told)
    assert said is not None
    assert int(said[1]) == finished
    assert 6 <= finished < TRIALS
    data = succeed(file, out, "--resume")
    assert parquet.read_table(out / "results.parquet").num_rows == TRIALS
    assert data != table


def test_bad_trials_are_rows(tmp_path: Path) -> None:
    document = campaign(
        controllers=["controllers.py:Faulty", "simple"], trials=5, seed=1, factors={"e_agents": [0, 400]}
    )
    file, out = written(tmp_path, document | {"fields": {"duration": [1.0]}}), tmp_path / "out"
    done = run(file, out, "--workers", "2", "--records", "failures")
    rows = parquet.read_table(out / "results.parquet").to_pylist()
    assert done.returncode == 1
    assert re.search(r"13 of 20 trials ended by a fault \(.*\); the first: trial ", done.stderr)
    assert len(rows) == 20
    ends = {(row["controller"], row["factor.e_agents"]): Counter[str]() for row in rows}
    for row in rows:
        ends[row["controller"], row["factor.e_agents"]][row["end"]] += 1
    assert ends["simple", 0] == {"duration": 5}
    assert ends["simple", 400] == ends["controllers.py:Faulty", 400] == {"failed": 5}
    faulty = ends["controllers.py:Faulty", 0]
    assert set(faulty) == {"duration", "controller_fault", "crashed"}
    reasons = {row["end"]: row["reason"] for row in rows}
    assert reasons["controller_fault"].startswith("ValueError: one goal is not enough at tick 5 (controllers.py:")
    assert "process that ran it ended" in reasons["crashed"]
    assert "fit on the road network" in reasons["failed"]
    records = {path.name for path in (out / "records").glob("*.mcap")}
    failed = {row["number"] for row in rows if row["end"] in ("controller_fault", "crashed")}
    assert records == {f"trial-{number:09d}.mcap" for number in failed}


@pytest.mark.tools
def test_a_full_disk_keeps_what_is_finished(tmp_path: Path, table: bytes) -> None:
    with small_disk(tmp_path / "disk", 64) as disk:
        file, out = written(tmp_path, campaign()), disk / "out"
        done = run(file, out, "--workers", "2")
        assert done.returncode == 2
        assert "No space left on device" in done.stderr
        assert not (out / "results.parquet").exists()
        finished, begun = kept(out), logged(tmp_path)
        assert 0 < finished < TRIALS
        subprocess.run(["mount", "-o", "remount,size=4m", str(disk)], check=True)
        assert succeed(file, out, "--resume", "--workers", "2") == table
        assert logged(tmp_path) - begun <= TRIALS - finished


def test_a_table_that_has_no_room_is_made_later(tmp_path: Path, table: bytes) -> None:
    file, out = written(tmp_path, campaign()), tmp_path / "out"
    limit = len(table) - 1000
    done = subprocess.run(
        command(file, out, "--workers", "1"),
        check=False,
        capture_output=True,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
    )
    assert done.returncode == 2
    assert "results.parquet: can't be written" in done.stderr
    assert "File too large" in done.stderr
    assert kept(out) == TRIALS
    begun = logged(tmp_path)
    assert succeed(file, out, "--resume") == table
    assert logged(tmp_path) == begun
    assert sorted(path.name for path in (out / "parts").iterdir()) == []


def test_two_runs_do_not_share_a_folder(tmp_path: Path) -> None:
    slow = campaign(controllers=["controllers.py:Slow"], factors={"duration": [100.0]})
    file, out = written(tmp_path, slow), tmp_path / "out"
    with subprocess.Popen(command(file, out, "--workers", "1")) as process:
        while not (out / "manifest.json").exists():
            time.sleep(0.02)
        second = run(file, out, "--resume")
        process.kill()
    assert second.returncode == 2
    assert f"{out}: in use by another process" in second.stderr


PATIENT = """
from pathlib import Path
import time

HERE = Path(__file__).parent


class Patient:
    def start(self, problem):
        with (HERE / "begun").open("a") as begun:
            begun.write("x")

    def act(self, observation):
        time.sleep(0.0 if (HERE / "go").exists() else 0.05)
        return 0.3, 0.1
"""


def test_trials_of_a_slow_controller_are_kept_one_by_one(tmp_path: Path) -> None:
    """A chunk of them was lost at Ctrl-C: none of 48 was kept after a third of the time."""
    document = campaign(controllers=["slow.py:Patient"], trials=24, factors={"duration": [1.0, 2.0]}, chunk=24)
    file = written(tmp_path, document)
    (tmp_path / "slow.py").write_text(PATIENT)
    out = tmp_path / "out"
    with subprocess.Popen(
        command(file, out, "--workers", "2"), stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        while kept(out) < 4 and process.poll() is None:
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        told = process.communicate()[1]
    before = kept(out)
    begun = len((tmp_path / "begun").read_text())
    assert process.returncode == 1
    assert f"interrupted; {before} of 48 trials are kept, --resume goes on" in told
    assert 4 <= before < 48
    assert begun - before <= 4  # each of the two workers was at one, and had one in waiting
    (tmp_path / "go").touch()
    whole = succeed(file, out, "--workers", "2", "--resume")
    assert len((tmp_path / "begun").read_text()) == begun + 48 - before
    assert succeed(file, tmp_path / "again", "--workers", "1") == whole
