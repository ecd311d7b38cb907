"""Controllers that end the program, answer nonsense or die: their own trials end, nothing is silent."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from dubins_traffic.cli.main import main
from dubins_traffic.engine.batch import run_batch
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.record.reader import read
from dubins_traffic.runs.single import run_trial
from tests.tools import need_module

COMMAND = [sys.executable, "-m", "dubins_traffic.cli"]
CONFIG: dict[str, Any] = {
    "version": 1,
    "problem_domain": "dubins_traffic",
    "rnd": {"version": 0, "length": 3, "shape": [3, 4]},
    "e-agents": [{"type": "wander", "name": "agent0"}],
    "duration": 1.0,
    "number_trials": 4,
}
HOSTILE = '''
import os, signal, sys


class Drives:
    def start(self, problem): ...
    def act(self, observation): return (0.3, 0.1)


class ExitsInStart(Drives):
    def start(self, problem): sys.exit()


class ExitsInAct(Drives):
    def act(self, observation):
        if observation.tick == 5:
            sys.exit(0)
        return (0.3, 0.1)


class ExitsInClose(Drives):
    def close(self): sys.exit()


class ExitsWhenMadeAgain(Drives):
    def __init__(self):
        with open("made", "a+") as made:
            made.write("x")
            if made.tell() > 4:
                sys.exit(0)


class ExitsInReport(Drives):
    def report(self): sys.exit()


class ReportsNonsense(Drives):
    def report(self): return 7


class Stops(Drives):
    def act(self, observation): raise GeneratorExit


class Dies(Drives):
    """Ends its process in the third trial."""
    def start(self, problem):
        self.dies = list(problem.goals)
    def act(self, observation):
        if os.environ["DIES_WITH"] == str(self.dies):
            os._exit(0)
        return (0.3, 0.1)


class DiesAlways(Drives):
    def act(self, observation): os._exit(0)


class Killed(Drives):
    def act(self, observation): os.kill(os.getpid(), signal.SIGKILL)


def deep(depth):
    if depth == 0:
        raise ValueError("lost\\x1b[31m\\nthe way")
    return deep(depth - 1)


class Lost(Drives):
    def act(self, observation):
        if observation.tick == 7:
            return deep(1)
        return (0.3, 0.1)


class Odd(type):
    @property
    def __name__(cls): raise ZeroDivisionError


class OddError(Exception, metaclass=Odd):
    @property
    def __traceback__(self): raise ZeroDivisionError


class RaisesOddly(Drives):
    def act(self, observation): raise OddError("odd")


class NamesItsEnd(Drives):
    """Says by itself that its trial is over, as those may who hear of others' programs."""
    end, detail = "duration", "all done"
    def act(self, observation):
        from dubins_traffic.errors import PeerError
        if observation.tick < 5:
            return (0.3, 0.1)
        error = PeerError(self.end, "")
        error.detail = self.detail
        raise error


class NamesNoEnd(NamesItsEnd):
    end = "glory"


class NamesNoDetail(NamesItsEnd):
    end, detail = "gave_up", 7


class ChangesTheProblem(Drives):
    def start(self, problem): problem.formulas["won"] = "G true"


class Disturbs(Drives):
    """Leaves this process otherwise than it was."""
    def start(self, problem):
        import tempfile, threading
        print("it starts")
        os.chdir(tempfile.gettempdir())
        os.fork()
    def act(self, observation):
        sys.stdout = None
        return (0.3, 0.1)


class LeavesAThread(Drives):
    def start(self, problem):
        import threading
        threading.Thread(target=threading.Event().wait, name="waits").start()


class IsTold(Drives):
    """Sends its own process the signal to end."""
    def act(self, observation):
        if observation.tick == 5:
            os.kill(os.getpid(), signal.SIGTERM)
        return (0.3, 0.1)


class Together(Drives):
    def start_batch(self, trials, problems): sys.exit(0)
    def act_batch(self, view): return [[0.0, 0.0]] * len(view.trial)


class TogetherActs(Drives):
    def start_batch(self, trials, problems): ...
    def act_batch(self, view): sys.exit(0)
'''


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "hostile.py").write_text(HOSTILE)
    (tmp_path / "exits.py").write_text("import sys\nsys.exit(0)\n")
    (tmp_path / "small.json").write_text(json.dumps(CONFIG))
    return tmp_path


def instance(trial: int = 0) -> Any:
    return draw(load_config(CONFIG), 0, trial)


def outside(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    import os

    return subprocess.run(
        [*COMMAND, *arguments],
        check=False,
        capture_output=True,
        text=True,
        timeout=600,
        env={**os.environ, **environment},
    )


FAULTY = {
    "RaisesOddly": "OddError: odd at tick 0 (hostile.py:",
    "NamesItsEnd": "PeerError: duration: ",
    "NamesNoEnd": "PeerError: glory: ",
    "NamesNoDetail": "PeerError: gave_up: ",
    "ChangesTheProblem": "TypeError: a problem is never changed: make a copy, by dict(...) at tick 0 (hostile.py:",
    "ExitsInStart": "SystemExit at tick 0 (hostile.py:",
    "ExitsInAct": "SystemExit: 0 at tick 5 (hostile.py:",
    "ExitsInReport": "SystemExit at tick 0 (hostile.py:",
    "ReportsNonsense": "TypeError: ",
    "Stops": "GeneratorExit at tick 0 (hostile.py:",
}


@pytest.mark.parametrize("name", FAULTY)
@pytest.mark.path
def test_whatever_a_controller_raises_ends_its_trial_alone_and_in_batches(name):
    single = run_trial(instance(), f"hostile.py:{name}").ending
    assert single.end == "controller_fault"
    assert single.detail.startswith(FAULTY[name])
    batch = run_batch(CONFIG, f"hostile.py:{name}", trials=2).outcomes
    assert [outcome.ending.end for outcome in batch] == ["controller_fault"] * 2
    assert batch[0].ending == single


@pytest.mark.parametrize("name", ["Together", "TogetherActs"])
def test_a_controller_of_batches_that_exits_ends_their_trials(name):
    endings = [outcome.ending for outcome in run_batch(CONFIG, f"hostile.py:{name}", trials=2).outcomes]
    assert [ending.end for ending in endings] == ["controller_fault"] * 2
    assert all(ending.detail.startswith("SystemExit: 0 at tick 0 (hostile.py:") for ending in endings)


def test_what_closing_raises_stands_in_the_detail():
    ending = run_trial(instance(), "hostile.py:ExitsInClose").ending
    assert ending.end == "duration"
    assert ending.detail.startswith("close raised SystemExit (hostile.py:")


@pytest.mark.parametrize("command", ["run", "batch"])
def test_a_class_that_exits_when_it_is_made_again_is_the_fault_of_that_trial(command, capsys):
    status = main([command, "small.json", "--controller", "hostile.py:ExitsWhenMadeAgain", "--json"])
    out, err = capsys.readouterr()
    assert status == 1
    ends = [trial["end"] for trial in json.loads(out)["trials"]]
    assert len(ends) == 4
    assert set(ends) == {"duration", "controller_fault"}
    assert "SystemExit: 0 at tick 0 (hostile.py:" in err


@pytest.mark.parametrize(
    "arguments",
    [
        ["run", "small.json", "--controller", "exits.py:Any"],
        ["batch", "small.json", "--controller", "exits.py:Any"],
        ["check-controller", "exits.py:Any"],
        ["run", "small.json", "--controller", "exits:Any"],
    ],
)
def test_a_file_that_exits_when_it_is_loaded_is_wrong_input(arguments, capsys):
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert "raised SystemExit: 0 (exits.py:2 in <module>: sys.exit(0)) while it was loaded" in err


class Unprintable:
    def __repr__(self) -> str:
        sys.exit()


class Number:
    def __init__(self, raises: BaseException) -> None:
        self.raises = raises

    def __float__(self) -> float:
        raise self.raises


def endless() -> Any:
    while True:
        yield 0.1


NONSENSE: dict[str, Callable[[], Any]] = {
    "huge integer": lambda: (10**400, 0.0),
    "huge integer that can't be printed": lambda: (10**5000, 0.0),
    "number that raises": lambda: (Number(ZeroDivisionError()), 0.0),
    "number that exits": lambda: (0.0, Number(SystemExit(0))),
    "no text": Unprintable,
    "generator": endless,
    "generator of two": lambda: (x for x in (0.1, 0.2)),
    "column": lambda: __import__("numpy").zeros((2, 1)),
    "matrix": lambda: __import__("numpy").zeros((2, 2)),
    "long row": lambda: __import__("numpy").zeros(3),
    "scalar": lambda: 0.3,
    "text": lambda: "12",
    "texts": lambda: ("0.1", "0.2"),
    "mapping": lambda: {0: 0.1, 1: 0.2},
    "set": lambda: {0.1, 0.2},
    "complex": lambda: (1j, 0.0),
    "NaN": lambda: (float("nan"), 0.0),
    "nothing": lambda: (),
    "a type": lambda: tuple,
}


@pytest.mark.parametrize("kind", NONSENSE)
@pytest.mark.path
def test_an_answer_that_is_nonsense_is_a_fault(kind):
    class Talks:
        def start(self, problem: object) -> None: ...

        def act(self, _observation: object) -> Any:
            return NONSENSE[kind]()

    single = run_trial(instance(), Talks()).ending
    assert single.end == "controller_fault"
    assert single.detail.startswith("a command is two ")
    assert len(single.detail) < 200
    assert run_batch(CONFIG, Talks, trials=1).outcomes[0].ending == single


def test_arrays_and_numbers_of_other_libraries_are_commands():
    import numpy as np

    class Talks:
        answers = (np.array([0.3, 0.1]), (np.float32(0.3), 0), [0.3, True], (np.array(0.3), 0.1))

        def start(self, problem: object) -> None: ...

        def act(self, observation: Any) -> Any:
            return self.answers[observation.tick % 4]

    assert run_trial(instance(), Talks()).ending.end == "duration"


def test_a_fault_tells_the_lines_that_led_to_it_without_paths(place):
    result = run_trial(instance(), f"{place}/hostile.py:Lost", record="a.mcap")
    detail = result.ending.detail
    assert detail.startswith(r"ValueError: lost\x1b[31m the way at tick 7 (hostile.py:")
    assert "in act: return deep(1) > hostile.py:" in detail
    assert 'in deep: raise ValueError("lost\\x1b[31m\\nthe way")' in detail
    assert str(place) not in detail
    assert read("a.mcap").ending == result.ending
    other = place / "elsewhere"
    other.mkdir()
    (other / "hostile.py").write_text(HOSTILE)
    run_trial(instance(), f"{other}/hostile.py:Lost", record="b.mcap")
    assert (place / "a.mcap").read_bytes() == (place / "b.mcap").read_bytes()
    assert str(place).encode() not in (place / "a.mcap").read_bytes()


def test_messages_of_faults_hold_no_folder_and_no_address(place):
    class Talks:
        def start(self, problem: object) -> None: ...

        def act(self, _observation: object) -> Any:
            raise OSError(f"{place}/x.txt is gone, says {object()}")

    detail = run_trial(instance(), Talks()).ending.detail
    assert detail.startswith("OSError: x.txt is gone, says <object object> at tick 0 (test_hostile_controllers.py:")


def test_debug_shows_the_whole_traceback(capsys, monkeypatch):
    monkeypatch.delenv("DUBINS_TRAFFIC_DEBUG", raising=False)
    arguments = ["run", "small.json", "--controller", "hostile.py:Lost", "--trials", "1"]
    assert main(arguments) == 1
    assert "Traceback" not in capsys.readouterr().err
    assert main(["--debug", *arguments]) == 1
    err = capsys.readouterr().err
    assert "Traceback" in err
    assert err.count("deep(") == 3 + 1


def test_trials_whose_processes_end_are_named_and_the_others_run():
    picked = instance(2).problem
    key = str(list(picked.goals))
    arguments = ["run", "small.json", "--controller", "hostile.py:Dies", "--jobs", "2", "--json"]
    done = outside(*arguments, "--records", "out", DIES_WITH=key)
    assert done.returncode == 1
    ran = [trial["trial"] for trial in json.loads(done.stdout)["trials"]]
    assert ran == [0, 1, 3]
    assert "the process ended in the middle of trial 2 (trial-0002.mcap)" in done.stderr
    again = outside(*arguments, "--records", "out", "--append", DIES_WITH="nobody")
    assert again.returncode == 0, again.stderr
    assert [trial["trial"] for trial in json.loads(again.stdout)["trials"]] == [2]


@pytest.mark.parametrize(("name", "jobs"), [("DiesAlways", "2"), ("Killed", "2"), ("DiesAlways", "1")])
def test_a_program_is_never_silent_where_all_processes_end(name, jobs):
    done = outside("run", "small.json", "--controller", f"hostile.py:{name}", "--jobs", jobs)
    assert done.returncode == 1
    assert "trial 0" in done.stderr
    assert done.stderr.count("\n") <= 5


def test_a_batch_is_not_silent_where_its_process_is_to_end():
    done = outside("batch", "small.json", "--controller", "hostile.py:DiesAlways", "--json")
    assert done.returncode == 1
    ends = {trial["end"] for trial in json.loads(done.stdout)["trials"]}
    assert ends == {"controller_fault"}
    assert "os._exit(0)" in done.stderr


CAMPAIGN = """
version = 0
trials = 3
controllers = ["simple", "hostile.py:ExitsInAct", "hostile.py:ExitsInStart", "hostile.py:ExitsWhenMadeAgain"]
configurations = ["small.json"]
"""


@pytest.mark.parametrize(
    "engine",
    [["--workers", "1"], pytest.param(["--ray", "local", "--workers", "1"], marks=pytest.mark.tools)],
)
def test_a_campaign_goes_on_where_controllers_exit(engine, place):
    if engine[0] == "--ray":
        need_module("ray")
    pyarrow = pytest.importorskip("pyarrow.parquet")
    (place / "c.toml").write_text(CAMPAIGN)
    done = outside("campaign", "run", "c.toml", "-o", "out", *engine)
    assert done.returncode == 1, done.stderr
    rows = pyarrow.read_table(place / "out" / "results.parquet").to_pylist()
    ends = {row["controller"]: {} for row in rows}
    for row in rows:
        ends[row["controller"]].setdefault(row["end"], []).append(row["reason"])
    assert len(rows) == 12
    assert set(ends["simple"]) == {"duration"}
    assert set(ends["hostile.py:ExitsInAct"]) == {"controller_fault"}
    assert set(ends["hostile.py:ExitsInStart"]) == {"controller_fault"}
    assert "controller_fault" in ends["hostile.py:ExitsWhenMadeAgain"]
    assert all("SystemExit" in reason for reason in ends["hostile.py:ExitsInAct"]["controller_fault"])
