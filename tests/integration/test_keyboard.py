"""`--controller keyboard` in a terminal of its own."""

import json
import os
import pty
import re
import signal
import subprocess
import sys
import termios
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from dubins_traffic.cli.main import main
from dubins_traffic.controllers.keyboard import Map
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.runs.single import Trial

pytestmark = pytest.mark.path

COMMAND = str(Path(sys.executable).with_name("dubins-traffic"))


class Terminal:
    """A terminal of 100 columns and 30 rows, in which `run demo --controller keyboard` is running."""

    def __init__(self) -> None:
        self.own, inner = pty.openpty()
        termios.tcsetwinsize(inner, (30, 100))
        self.before = termios.tcgetattr(self.own)
        self.screen = ""
        command = [
            COMMAND,
            "run",
            "demo",
            "--seed",
            "1",
            "--controller",
            "keyboard",
            "--trials",
            "1",
            "--json",
        ]
        self.process = subprocess.Popen(command, stdin=inner, stdout=subprocess.PIPE, stderr=inner, text=True)
        os.close(inner)
        self.reader = threading.Thread(target=self.read)
        self.reader.start()

    def read(self) -> None:
        while True:
            try:
                data = os.read(self.own, 65536)
            except OSError:
                return
            self.screen += data.decode(errors="replace")

    def see(self, text: str) -> None:
        until = time.monotonic() + 600
        while text not in self.screen:
            assert time.monotonic() < until, self.screen[-2000:]
            time.sleep(0.02)

    def type(self, keys: str) -> None:
        os.write(self.own, keys.encode())

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.communicate(timeout=600)
        self.reader.join(10)
        os.close(self.own)


@pytest.fixture
def terminal() -> Iterator[Terminal]:
    made = Terminal()
    yield made
    made.close()


def test_a_person_drives_and_gives_up(terminal: Terminal) -> None:
    terminal.see("space: stop")
    terminal.type("\x1b[A" * 3 + "\x1b[D")
    terminal.see("+0.3 m/s   +0.3 rad/s")
    assert "↗" in terminal.screen or "→" in terminal.screen
    terminal.type(" ")
    terminal.see("+0.0 m/s   +0.0 rad/s")
    terminal.type("q")
    out, _ = terminal.process.communicate(timeout=600)
    trial = json.loads(out)["trials"][0]
    assert trial["end"] == "gave_up"
    assert terminal.screen.rstrip().endswith("\x1b[?25h\x1b[?1049l") or "\x1b[?1049l" in terminal.screen


def test_time_begins_with_the_first_key_and_there_is_a_legend(terminal: Terminal) -> None:
    terminal.see("press a key of the last line to start")
    terminal.type("x")  # no key of the keyboard's
    until = time.monotonic() + 600
    while terminal.screen.count("press a key") < 4:
        assert time.monotonic() < until
        time.sleep(0.02)
    assert set(re.findall(r"(\d+\.\d) s ", terminal.screen)) == {"0.0"}
    for part in ("→ you", "o ' another car", "1, 2, ... goals", "q: give up"):
        assert part in terminal.screen
    terminal.type("\x1b[A")
    terminal.see("0.5 s   +0.1 m/s")
    assert "press a key" not in terminal.screen.rpartition("\x1b[H")[2]
    terminal.type("q")
    out, _ = terminal.process.communicate(timeout=600)
    assert json.loads(out)["trials"][0]["end"] == "gave_up"


def test_goals_at_one_place_have_their_numbers_joined_as_in_pictures() -> None:
    instance = draw(load_config("demo"), 1, 0)
    goal = instance.problem.goals[0]
    problem = replace(instance.problem, goals=(goal, goal))
    with Trial(instance) as trial:
        seen = trial.observation
    assert "1+2" in "\n".join(Map(problem).draw(seen, 80, 24))


def test_ctrl_c_gives_the_terminal_back(terminal: Terminal) -> None:
    terminal.see("space: stop")
    assert termios.tcgetattr(terminal.own) != terminal.before
    terminal.process.send_signal(signal.SIGINT)
    terminal.see("\x1b[?1049l")
    deadline = time.monotonic() + 600
    while termios.tcgetattr(terminal.own) != terminal.before:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    terminal.process.communicate(timeout=600)
    assert terminal.process.returncode == 1


def test_without_a_terminal_it_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "demo", "--controller", "keyboard"]) == 2
    assert "needs a terminal" in capsys.readouterr().err


def test_the_map_shows_roads_goals_and_cars() -> None:
    instance = draw(load_config("demo"), 1, 0)
    with Trial(instance) as trial:
        seen = trial.observation
    lines = Map(instance.problem).draw(seen, 80, 24)
    text = "\n".join(lines)
    assert len(lines) == 24
    assert max(map(len, lines)) <= 80
    assert text.count("→") == 1
    assert text.count("o") == len(seen.others)
    assert all(str(number + 1) in text for number in range(len(instance.problem.goals)))
    assert "0" not in text
    assert text.count("·") > 100
