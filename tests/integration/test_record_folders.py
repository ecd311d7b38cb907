"""Folders of records: nothing is replaced or mixed without a word, and one run writes at a time."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from dubins_traffic.cars.state import Pose
from dubins_traffic.cli.main import main
from dubins_traffic.engine.batch import run_batch
from dubins_traffic.errors import InputError
from dubins_traffic.files import locked
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.runs.record_folder import Earlier, claim
from dubins_traffic.runs.single import run_trial

COMMAND = [sys.executable, "-m", "dubins_traffic.cli"]
CONFIG: dict[str, Any] = {
    "version": 1,
    "problem_domain": "dubins_traffic",
    "rnd": {"version": 0, "length": 3, "shape": [2, 2]},
    "duration": 1.0,
    "number_trials": 3,
}
MINE = """
import time

class Straight:
    def start(self, problem): ...
    def act(self, observation): return (0.3, 0.0)

class Turning(Straight):
    def act(self, observation): return (0.3, 0.1)

class Slow(Straight):
    def act(self, observation):
        time.sleep(0.1)
        return (0.3, 0.0)
"""
RUN = ["run", "small.json", "--controller", "mine.py:Straight", "--json", "--records", "out"]
SESSION = ["lines", "run", *RUN[1:], "--lockstep"]
OVER = {
    "lines": ["lines", "run"],
    "lcm": ["lcm", "run"],
    "ros1": ["ros1", "run", "--master"],
    "ros1 under another maestro": ["ros1", "run", "--master", "--maestro-elsewhere"],
    "ros2": ["ros2", "run"],
}
BATCH = [
    "batch",
    "small.json",
    "--controller",
    "mine.py:Straight",
    "--json",
    "--keep",
    "all",
    "--records",
    "out",
]


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(MINE)
    (tmp_path / "small.json").write_text(json.dumps(CONFIG))
    return tmp_path


@pytest.fixture
def call(capsys: pytest.CaptureFixture[str]) -> Any:
    """Return a function that runs a command and returns status, the numbers of the trials shown, and messages."""

    def command(*arguments: str) -> tuple[int, list[int], str]:
        capsys.readouterr()
        status = main(list(arguments))
        out, err = capsys.readouterr()
        return status, [trial["trial"] for trial in json.loads(out)["trials"]] if out else [], err

    return command


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.suffix == ".mcap"}


@pytest.mark.parametrize("first", [RUN, BATCH])
@pytest.mark.path
def test_a_folder_that_holds_records_is_refused_and_left(first, call, place):
    assert call(*first)[:2] == (0, [0, 1, 2])
    before = contents(place / "out")
    assert sorted(before) == ["trial-0000.mcap", "trial-0001.mcap", "trial-0002.mcap"]
    for again in (RUN, BATCH):
        status, shown, err = call(*again)
        assert (status, shown) == (2, [])
        assert "out: holds trial-0000.mcap and 2 more; expected a folder without records" in err
        assert "--overwrite" in err
        assert "--append" in err
    assert contents(place / "out") == before


@pytest.mark.parametrize("over", OVER)
def test_sessions_refuse_a_folder_that_holds_records_before_they_open_anything(over, call, place):
    assert call(*RUN)[0] == 0
    before = contents(place / "out")
    status, shown, err = call(*OVER[over], *RUN[1:])
    assert (status, shown) == (2, [])
    assert "out: holds trial-0000.mcap and 2 more; expected a folder without records; --overwrite" in err
    assert "compil" not in err
    assert call(*OVER[over], *RUN[1:], "--append", "--seed", "7")[0] == 2
    assert contents(place / "out") == before


@pytest.mark.parametrize("command", [RUN, BATCH, SESSION])
def test_overwrite_removes_what_was_there(command, call, place):
    assert call(*command)[0] == 0
    (place / "out" / "notes.txt").write_text("mine")
    (place / "out" / "other.mcap").write_text("not of a run")
    other = [*command, "--trials", "2", "--seed", "4", "--overwrite"]
    assert call(*other)[:2] == (0, [0, 1])
    assert sorted(contents(place / "out")) == ["other.mcap", "trial-0000.mcap", "trial-0001.mcap"]
    assert not (place / "out" / "trial-0002.wall.json").exists()
    assert (place / "out" / "notes.txt").read_text() == "mine"


@pytest.mark.parametrize("command", [RUN, BATCH, SESSION])
def test_append_goes_on_and_ends_in_the_same_bytes(command, call, place):
    assert call(*command)[0] == 0
    whole = contents(place / "out")
    (place / "out" / "trial-0001.mcap").unlink()
    cut = place / "out" / "trial-0002.mcap"
    cut.write_bytes(cut.read_bytes()[: cut.stat().st_size // 2])
    status, shown, err = call(*command, "--append")
    assert (status, shown) == (0, [0, 1, 2] if command is BATCH else [1, 2])
    assert contents(place / "out") == whole
    if command is not BATCH:
        assert "1 trials have their records in out" in err
    assert call(*command, "--append", "--trials", "4")[0] == 0
    assert sorted(contents(place / "out")) == [*sorted(whole), "trial-0003.mcap"]


@pytest.mark.parametrize("command", [RUN, BATCH, SESSION])
@pytest.mark.parametrize(
    ("change", "needle"),
    [
        (["--controller", "mine.py:Turning"], "trial-0000.mcap: a record of another controller"),
        (["--seed", "7"], "trial-0000.mcap: a record of another seed"),
        (["longer"], "trial-0000.mcap: a record of another instance"),
    ],
)
def test_append_refuses_records_of_another_run(command, change, needle, call, place):
    assert call(*command)[0] == 0
    before = contents(place / "out")
    if change == ["longer"]:
        (place / "small.json").write_text(json.dumps({**CONFIG, "duration": 2.0}))
        change = []
    status, shown, err = call(*command, *change, "--append")
    assert (status, shown) == (2, [])
    assert needle in err
    assert contents(place / "out") == before


def test_a_session_goes_on_with_the_repetition_that_was_broken_off(place):
    out = place / "out"
    out.mkdir()
    for name in ("0000", "0000-1", "0001", "0001-1", "0001-2", "0002", "0003-1"):
        (out / f"trial-{name}.mcap").touch()
    (out / "mine.mcap").touch()
    whole = {f"trial-{name}.mcap" for name in ("0000", "0000-1", "0001", "0001-1", "0002")}
    assert Earlier.of(out, frozenset(whole)) == Earlier(frozenset({0, 2}), {1: 2, 3: 1})


def test_records_of_cars_that_were_put_elsewhere_are_of_the_same_session(place):
    drawn = draw(load_config(CONFIG), 0, 0)
    moved = replace(drawn, starts=(Pose(1.25, 0.0, 1.0, 0.0),))
    (place / "out").mkdir()
    run_trial(moved, "simple", record=place / "out" / "trial-0000.mcap")
    with pytest.raises(InputError, match="another instance"):
        claim(place / "out", "simple", lambda _: drawn, append=True)
    assert claim(place / "out", "simple", lambda _: drawn, append=True, placed=True) == {"trial-0000.mcap"}


def test_runs_of_one_instance_append_too(call, place):
    main(["instance", "small.json", "--full", "-o", "one.json"])
    command = [
        "run",
        "one.json",
        "--controller",
        "mine.py:Straight",
        "--json",
        "--records",
        "out",
        "--repeat",
    ]
    assert call(*command, "2")[0] == 0
    assert call(*command, "3", "--append")[:2] == (0, [0])
    assert sorted(contents(place / "out")) == [f"trial-0000-000{k}.mcap" for k in range(3)]
    assert call("run", "one.json", "--records", "out", "--append")[0] == 2


@pytest.mark.parametrize(
    ("options", "needles"),
    [
        (["--records", ""], ["--records", "got ''"]),
        (["--overwrite"], ["--overwrite", "--append"]),
        (["--records", "out", "--overwrite", "--append"], ["both at once"]),
        (["--records", "out", "--append", "-f", "data.json"], ["--append, -f", "both at once"]),
    ],
)
@pytest.mark.parametrize("command", [["run"], ["lines", "run"]])
def test_choices_that_make_no_sense_are_refused(command, options, needles, call, place):
    status, _, err = call(*command, "small.json", *options)
    assert status == 2
    assert all(needle in err for needle in needles)
    assert not (place / "data.json").exists()


def test_trials_of_another_maestro_are_not_appended(call):
    status, _, err = call(*OVER["ros1 under another maestro"], *RUN[1:], "--append")
    assert status == 2
    assert "--maestro-elsewhere, --append: both at once" in err


@pytest.mark.parametrize("first", [["run"], ["lines", "run"]])
def test_a_second_run_into_one_folder_is_refused_until_the_first_has_ended(first, call, place):
    command = [
        *COMMAND,
        *first,
        "small.json",
        "--controller",
        "mine.py:Slow",
        "--trials",
        "90",
        "--records",
        "out",
    ]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as running:
        try:
            until = time.monotonic() + 600
            while not list(place.glob("out/*.mcap")):
                assert time.monotonic() < until
                assert running.poll() is None
                time.sleep(0.05)
            for extra in (["--append"], ["--overwrite"], []):
                for other in (RUN, SESSION):
                    status, _, err = call(*other, *extra)
                    assert status == 2
                    assert "out: in use by another process" in err
        finally:
            running.send_signal(signal.SIGKILL)
    assert call(*RUN, "--overwrite")[0] == 0


def test_from_python_the_same(place):
    run_batch(CONFIG, "simple", trials=1, keep="all", records="out")
    with pytest.raises(InputError, match="holds trial-0000"):
        run_batch(CONFIG, "simple", trials=1, keep="all", records="out")
    run_batch(CONFIG, "simple", trials=2, keep="all", records="out", append=True)
    assert len(contents(place / "out")) == 2
    with locked(place / "out"), pytest.raises(InputError, match="in use"):
        run_batch(CONFIG, "simple", trials=1, keep="all", records="out", overwrite=True)
