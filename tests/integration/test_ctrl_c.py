"""Whenever Ctrl-C comes, a command ends with one line and its status, and without a traceback."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from dubins_traffic.cli import signals
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


def test_one_that_comes_while_a_dropped_one_is_heard_is_not_dropped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """On a busy machine the thread that presses again may be done before the one that began it has gone on."""

    press, press_soon, pressed = signals._press, signals._press_soon, threading.Event()

    def press_and_tell(number: int) -> None:
        press(number)
        pressed.set()

    def go_on_late(number: int) -> None:
        press_soon(number)
        pressed.wait()

    monkeypatch.setattr(signals, "_press", press_and_tell)
    monkeypatch.setattr(signals, "_press_soon", go_on_late)
    test_one_that_python_drops_is_heard_all_the_same(tmp_path, monkeypatch, capsys)


def test_a_sigterm_that_python_drops_is_heard_where_ctrl_c_is_ignored(tmp_path: Path) -> None:
    """As in a program that a script has begun in the background."""
    (tmp_path / "mine.py").write_text(DROPPED.replace("SIGINT", "SIGTERM"))
    words = [sys.executable, "-m", "dubins_traffic.cli", "run", "demo", "--controller", "mine.py:Ringing"]
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=600, check=False)
    finally:
        signal.signal(signal.SIGINT, before)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith("dubins-traffic: interrupted after 0 of ")


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


BEFORE_IT_LISTENS = """
import signal, sys


def hear(event, given):
    if event == "import" and given[0] == sys.argv[1]:
        signal.raise_signal(signal.SIGINT)


sys.addaudithook(hear)
from dubins_traffic.cli.__main__ import main
"""


@pytest.mark.parametrize("module", ["dubins_traffic.cli.main", "threading", "dubins_traffic.runs"])
@pytest.mark.path
def test_before_the_program_listens(module: str) -> None:
    done = ran(BEFORE_IT_LISTENS, module)
    assert (done.returncode, done.stdout, done.stderr) == (
        -signal.SIGINT,
        "",
        "dubins-traffic: interrupted\n",
    )


STUBBORN = """
import sys, time


class Stubborn:
    def start(self, problem):
        pass

    def act(self, observation):
        while True:
            try:
                print("asked", file=sys.stderr, flush=True)
                time.sleep(600)
            except BaseException as error:
                print("caught", type(error).__name__, file=sys.stderr, flush=True)
"""
CAMPAIGN = """
version = 0
name = "stubborn"
configurations = ["demo"]
trials = 2
seed = 0
controllers = ["mine.py:Stubborn"]
"""
HERE = {
    "run": ["run", "demo", "--controller", "mine.py:Stubborn"],
    "batch": ["batch", "demo", "--controller", "mine.py:Stubborn", "--trials", "2"],
    "falsify": ["falsify", "junction", "--controller", "mine.py:Stubborn", "--trials", "2"],
}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("name", sorted(HERE))
def test_the_second_ends_a_program_whatever_a_controller_catches(
    name: str, number: signal.Signals, tmp_path: Path
) -> None:
    (tmp_path / "mine.py").write_text(STUBBORN)
    words = [sys.executable, "-m", "dubins_traffic.cli", *HERE[name]]
    with subprocess.Popen(words, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as process:
        wait_for("asked", process)
        process.send_signal(number)
        wait_for("caught KeyboardInterrupt", process)
        process.send_signal(number)
        assert process.wait() == -number


def test_the_second_ends_a_campaign_and_its_workers(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(STUBBORN)
    (tmp_path / "c.toml").write_text(CAMPAIGN)
    words = [
        sys.executable,
        "-m",
        "dubins_traffic.cli",
        "campaign",
        "run",
        "c.toml",
        "-o",
        "c",
        "--workers",
        "1",
    ]
    with subprocess.Popen(words, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as process:
        wait_for("asked", process)
        while process.poll() is None:  # two that come at once are heard as one
            process.send_signal(signal.SIGINT)
            time.sleep(0.05)
        assert process.wait() == -signal.SIGINT
        assert process.stderr is not None
        process.stderr.read()  # it ends when the worker, who holds the other end, too, has ended


def wait_for(line: str, process: subprocess.Popen[str]) -> None:
    assert process.stderr is not None
    assert line in iter(lambda: process.stderr.readline().strip() if process.stderr else "", ""), "it has ended"


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
