"""The examples at the foot of help texts: all can be read, those of sessions run, attach.md's launch file too."""

from __future__ import annotations

import os
import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

from dubins_traffic.cli.commands import app
from tests.ports import kept_domain, kept_port
from tests.ros import PATIENCE, ROOT, Graph, configuration, graph, need_ros, read_until
from tests.tools import need_module


def commands(group: Any) -> Iterator[Any]:
    for command in group.commands.values():
        if hasattr(command, "commands"):
            yield from commands(command)
        else:
            yield command


def examples() -> list[str]:
    texts = [command.epilog or "" for command in commands(typer.main.get_command(app))]
    return [line for text in texts for line in re.findall(r"^\$ dubins-traffic (.*)$", text, re.MULTILINE)]


@pytest.mark.parametrize("line", examples())
@pytest.mark.path
def test_an_example_can_be_read(line: str) -> None:
    command: Any = typer.main.get_command(app)
    words = shlex.split(line.partition(" | ")[0].partition(" > ")[0])
    context = None
    while hasattr(command, "commands"):
        context = command.make_context(words[0], words, parent=context)
        _, command, words = command.resolve_command(context, words)
    command.make_context(words[0] if words else "", words, parent=context)


SESSIONS = [
    pytest.param(line, marks=pytest.mark.tools) if line.startswith(("ros1", "lcm")) else line
    for line in examples()
    if re.match(r"(ros1|ros2|lcm|lines) run ", line)
]


@pytest.mark.parametrize("line", SESSIONS)
@pytest.mark.path
def test_an_example_of_a_session_runs_and_says_what_it_does(line: str, tmp_path: Path) -> None:
    """It compiles, says where it is and what it waits for, and ends as asked."""
    kind = line.partition(" ")[0]
    if kind == "ros1":
        need_ros()
    elif kind == "lcm":
        need_module("lcm")
    configuration(tmp_path).rename(tmp_path / "my-trials.json")
    own_core = kind == "ros1" and "--master" not in line
    with graph(tmp_path, core=own_core) as ros:
        command = [sys.executable, "-m", "dubins_traffic.cli", *shlex.split(line)]
        around = {**ros.environment, "ROS_DOMAIN_ID": str(kept_domain()), "PYTHONPATH": str(ROOT / "src")}
        process = subprocess.Popen(command, cwd=tmp_path, env=around, stderr=subprocess.PIPE, text=True)
        said = read_until(process, r"\((1 of \d+)\): (waiting for|begins)")
        os.kill(process.pid, signal.SIGTERM)
        _, rest = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert "interrupted after 0 trials" in rest
    place = {
        "ros1": "ROS master at http://",
        "ros2": "DDS domain ",
        "lcm": "LCM at udpm://",
        "lines": "JSON lines at ",
    }
    long = ("compiling", "compiled") if "compiling" in said else ()  # said where it takes more than a moment
    order = [said.index(word) for word in (*long, place[kind], "trial 0 (1 of")]
    assert order == sorted(order)


@pytest.mark.tools
def test_the_launch_file_works_as_typed(tmp_path: Path) -> None:
    need_ros()
    text = (ROOT / "docs" / "attach.md").read_text(encoding="utf-8")
    section = text.partition("### From roslaunch")[2].partition("\n### ")[0]
    (typed,) = re.findall(r"```bash\n(.*?)```", section, re.DOTALL)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    own = tmp_path / "bin" / "dubins-traffic"
    own.parent.mkdir()
    own.write_text(
        f'#!/bin/sh\nPYTHONPATH={ROOT / "src"}:$PYTHONPATH exec {sys.executable} -m dubins_traffic.cli "$@"\n'
    )
    own.chmod(0o755)
    around = Graph(tmp_path, kept_port()).environment
    around.pop("PYTHONPATH", None)
    around["PATH"] = f"{own.parent}:{around['PATH']}"
    process = subprocess.Popen(
        ["bash", "-e", "-c", typed], cwd=tmp_path, env=around, start_new_session=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        said = read_until(process, r"trial 0 \(1 of \d+\): begins")
    finally:
        os.killpg(process.pid, signal.SIGINT)
        process.communicate(timeout=PATIENCE)
    assert "waiting for READY and START" in said
    assert "ModuleNotFoundError" not in said
