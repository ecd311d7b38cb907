"""What controllers do to the process in which they drive: it does not outlast them, and signals end it in one line."""

from __future__ import annotations

import json
import os
import pickle
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from dubins_traffic.record.reader import read
from tests.integration.test_hostile_controllers import COMMAND, instance, outside, place
from tests.services import wait_until

__all__ = ["place"]


def test_what_a_problem_says_is_the_same_elsewhere_and_can_be_copied():
    problem = instance().problem
    again = pickle.loads(pickle.dumps(problem))
    assert again.rules == problem.rules
    assert {**problem.formulas, "mine": "G true"}["mine"] == "G true"
    for mapping in (problem.rules, again.rules, problem.car.parameters):
        with pytest.raises(TypeError, match="never changed"):
            mapping["stop_time"] = 1e9  # pyright: ignore[reportIndexIssue]


@pytest.mark.parametrize("command", [["run"], ["run", "--jobs", "2"], ["batch", "--keep", "all"]])
def test_what_a_controller_does_to_the_process_does_not_outlast_it(command, place):
    """It goes to another folder, forks, prints and takes standard output away: results are where they belong, once."""
    options = ["--controller", "hostile.py:Disturbs", "--records", "out", "--trials", "2", "--json"]
    done = outside(command[0], "small.json", *command[1:], *options)
    assert done.returncode == 0, done.stderr
    trials = json.loads(done.stdout)["trials"]
    assert [(trial["end"], trial["record"]) for trial in trials] == [
        ("duration", f"out/trial-{k:04d}.mcap") for k in range(2)
    ]
    assert done.stderr.count("it starts") >= 2
    assert sorted(path.name for path in (place / "out").iterdir()) == [
        f"trial-{k:04d}.{end}" for k in range(2) for end in ("mcap", "wall.json")
    ]
    assert [read(trial["record"]).ending.end for trial in trials] == ["duration"] * 2


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_a_program_ends_though_threads_were_left_behind(jobs):
    options = ["--controller", "hostile.py:LeavesAThread", "--trials", "2", "--jobs", jobs, "--json"]
    done = outside("run", "small.json", *options)
    assert done.returncode == 0, done.stderr
    assert len(json.loads(done.stdout)["trials"]) == 2
    assert "threads were left behind and are ended: waits" in done.stderr


def test_sigterm_is_heard_as_ctrl_c_is():
    done = outside("run", "small.json", "--controller", "hostile.py:IsTold", "--records", "out")
    assert (done.returncode, done.stderr) == (1, "dubins-traffic: interrupted after 0 of 4 trials\n")
    assert read("out/trial-0000.mcap").ending.end == "interrupted"


def test_ctrl_c_before_anything_runs_is_told_in_a_line(place):
    (place / "interrupts.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGINT)\n")
    done = outside("run", "small.json", "--controller", "interrupts.py:Any")
    assert (done.returncode, done.stderr) == (1, "dubins-traffic: interrupted\n")


def test_ctrl_c_while_the_program_is_loaded_leaves_no_traceback(place):
    (place / "typer.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGINT)\n")
    paths = os.pathsep.join([str(place), *sys.path])
    done = outside("list", "agents", PYTHONPATH=paths)
    assert (done.returncode, done.stdout, done.stderr) == (1, "", "dubins-traffic: interrupted\n")


CAMPAIGN = """
version = 0
trials = 2
controllers = ["simple"]
configurations = ["small.json"]
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_workers_begin_is_told_in_a_line(number, place):
    (place / "c.toml").write_text(CAMPAIGN)
    words = [*COMMAND, "campaign", "run", "c.toml", "-o", "out", "--workers", "2"]
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True, start_new_session=True) as process:
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
        wait_until(lambda: len(children.read_text().split()) > 1, pause=0.01)
        process.send_signal(number)
        _, said = process.communicate(timeout=600)
    assert process.returncode == 1, said
    assert said.count("\n") == 1, said
    assert "interrupted; 0 of " in said


COMPILED = """
import ctypes
import os

LIBRARY = ctypes.CDLL(None)


class Compiled:
    def start(self, problem):
        LIBRARY.printf(b"held back until the end\\n")
        LIBRARY.puts(b"put")
        os.write(1, b"written\\n")

    def act(self, observation):
        return 0.3, 0.1
"""


def test_what_compiled_code_prints_is_no_result(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(COMPILED)
    words = [sys.executable, "-m", "dubins_traffic.cli", "run", "demo", "--trials", "1", "--json"]
    done = subprocess.run(
        [*words, "--controller", "mine.py:Compiled"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert len(json.loads(done.stdout)["trials"]) == 1
    for said in ("held back until the end", "put", "written"):
        assert f"{said}\n" in done.stderr


def test_no_width_of_a_terminal_hides_the_scores() -> None:
    words = [
        sys.executable,
        "-m",
        "dubins_traffic.cli",
        "run",
        "demo",
        "--trials",
        "1",
        "--controller",
        "simple",
    ]
    shown = [
        subprocess.run(words, env={**os.environ, "COLUMNS": width}, capture_output=True, check=True).stdout
        for width in ("0", "-3", "wide", "")
    ]
    assert b"rounds" in shown[0]
    assert len(set(shown)) == 1


def test_a_system_without_locks_is_refused_with_a_word() -> None:
    code = "import sys; sys.modules['fcntl'] = None\nfrom dubins_traffic.cli.main import main\nsys.exit(main())"
    done = subprocess.run([sys.executable, "-c", code, "list", "agents"], capture_output=True, text=True, check=False)
    said = "dubins-traffic: this system has no locks for files (fcntl): Linux or macOS is needed\n"
    assert (done.returncode, done.stdout, done.stderr) == (2, "", said)


WITHOUT_SHARED_LOCKS = """
import _multiprocessing, sys


class Refused:
    SEM_VALUE_MAX = 1

    def __init__(self, *_):
        raise PermissionError(13, "Permission denied")


_multiprocessing.SemLock = Refused
from dubins_traffic.cli.main import main

sys.exit(main())
"""
"""The program on a machine whose /dev/shm is missing or may not be written, as in many a chroot."""


@pytest.mark.parametrize(
    "words",
    [["run", "demo", "--jobs", "2"], ["campaign", "run", "c.toml", "-o", "out", "--workers", "2"]],
    ids=lambda words: words[0],
)
def test_where_processes_share_no_lock_what_is_missing_is_named(words: list[str], tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text(CAMPAIGN.replace("small.json", "demo"))
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_SHARED_LOCKS, *words],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (2, "")
    last = done.stderr.splitlines()[-1]
    assert last.startswith("dubins-traffic: no processes run beside this one")
    assert "(Permission denied): /dev/shm must be there" in last
