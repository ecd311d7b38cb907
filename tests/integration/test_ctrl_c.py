"""Whenever Ctrl-C comes, a command ends with one line and its status, and without a traceback."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from dubins_traffic.cli.main import main

DROPPED = """
import signal


class Bell:
    def __del__(self):
        signal.raise_signal(signal.SIGINT)


class Ringing:
    def start(self, problem):
        self.ticks = 0

    def act(self, observation):
        self.ticks += 1
        if self.ticks == 40:
            Bell()
        return 0.3, 0.1
"""
"""A controller that is interrupted in a destructor: Python drops what is raised there."""

AT_AN_IMPORT = """
import signal, sys
from dubins_traffic.cli.main import main

count = int(sys.argv.pop(1))


def hear(event, _):
    global count
    count -= event == "import"
    if count == 0 and event == "import":
        signal.raise_signal(signal.SIGINT)


sys.addaudithook(hear)
sys.exit(main())
"""
"""A program that is interrupted when it imports its so manieth module."""

AT_ITS_END = """
import atexit, signal, sys
from dubins_traffic.cli.main import main

atexit.register(signal.raise_signal, signal.SIGINT)
status = main()
signal.raise_signal(signal.SIGINT)
sys.exit(status)
"""
"""A program that is interrupted when its command is over."""


def ran(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    words = [sys.executable, "-c", code, *arguments]
    return subprocess.run(words, capture_output=True, text=True, timeout=600, check=False)


def test_one_that_python_drops_is_heard_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(DROPPED)
    assert main(["run", "demo", "--controller", "mine.py:Ringing", "--trials", "3"]) == 1
    assert capsys.readouterr() == ("", "dubins-traffic: interrupted after 0 of 3 trials\n")


IN_A_TEXT = """
import signal


class Ringing:
    def start(self, problem):
        pass

    def act(self, observation):
        if observation.tick == 40:
            exec("signal.raise_signal(signal.SIGINT)")
        return 0.3, 0.1
"""


def test_one_in_a_text_that_is_run_ends_with_the_status_of_any_other(tmp_path: Path) -> None:
    """As all classes of records are made. Python would send itself the signal again in the end."""
    (tmp_path / "mine.py").write_text(IN_A_TEXT)
    words = [sys.executable, "-m", "dubins_traffic.cli", "run", "demo", "--controller", "mine.py:Ringing"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=600, check=False)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith("dubins-traffic: interrupted after 0 of ")
    assert done.stderr.count("\n") == 1


def test_one_that_comes_in_other_words_is_one(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Pressed:
        def __set_name__(self, owner: type, name: str) -> None:
            signal.raise_signal(signal.SIGINT)

    def press(*_given: object, **_named: object) -> None:
        type("Named", (), {"pressed": Pressed()})

    monkeypatch.setattr("dubins_traffic.runs.sources.load", press)
    assert main(["plot", __file__, "-o", "a.png"]) == 1
    assert capsys.readouterr() == ("", "dubins-traffic: interrupted\n")


@pytest.mark.parametrize("count", [1, 20, 150, 500])
def test_while_the_program_begins(count: int) -> None:
    done = ran(AT_AN_IMPORT, str(count), "run", "demo", "--trials", "1")
    assert (done.returncode, done.stdout, done.stderr) == (1, "", "dubins-traffic: interrupted\n")


def test_when_all_is_done() -> None:
    done = ran(AT_ITS_END, "list", "agents")
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("arguments", [("score", "{}"), ("plot", "{}", "-o", "a.png")])
def test_a_command_that_has_nothing_to_keep_says_so(
    arguments: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def press(*_given: object, **_named: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("dubins_traffic.record.reader.read", press)
    monkeypatch.setattr("dubins_traffic.runs.sources.load", press)
    assert main([word.format(__file__) for word in arguments]) == 1
    assert capsys.readouterr() == ("", "dubins-traffic: interrupted\n")
