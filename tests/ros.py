"""A ROS graph for tests: a real roscore on a free port, nodes as child processes, nothing left behind."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from dubins_traffic.transports.ros1.master import answers
from dubins_traffic.transports.ros1.messages import DIST_PACKAGES, write_python
from tests.ports import kept_port
from tests.tools import need, need_programs

CARS = ("ego", "0", "-0.3", "0", "agent0", "3", "3", "0")
"""The cars of a world outside, as `tests/cars_outside.py` takes them."""
ROOT = Path(__file__).resolve().parents[1]
SYSTEM_PYTHON = "/usr/bin/python3"
PATIENCE = 600.0
"""Seconds after which a test gives up: more than anything takes on a busy machine."""


def need_ros() -> None:
    """Skip the test, or fail it under CI, where Debian's ROS packages are missing."""
    lacking = [name for name in ("rospy", "rosmaster", "roslib") if not Path(DIST_PACKAGES, name).is_dir()]
    lacking += [name for name in ("roscore", "g++") if shutil.which(name) is None]
    need(", ".join(lacking), "scripts/system-packages.sh installs it")


def need_compiler() -> None:
    """Skip the test, or fail it under CI, where no program in C++ can be made."""
    need_programs("make", "g++")


class Graph:
    """What runs on one ROS master; `close` ends all of it."""

    def __init__(self, folder: Path, port: int | None = None) -> None:
        self.folder = folder
        self.port = port or kept_port()
        self.uri = f"http://127.0.0.1:{self.port}/"
        self.processes: list[subprocess.Popen[str]] = []
        self.environment = {
            **os.environ,
            "ROS_MASTER_URI": self.uri,
            "ROS_IP": "127.0.0.1",
            "ROS_HOME": str(folder / "ros"),
            "ROS_LOG_DIR": str(folder / "ros" / "log"),
            "PYTHONUNBUFFERED": "1",
        }

    def roscore(self) -> subprocess.Popen[str]:
        """Start a roscore and wait until it answers."""
        core = self.start([SYSTEM_PYTHON, str(shutil.which("roscore")), "-p", str(self.port)])
        self.await_master()
        return core

    def await_master(self) -> None:
        """Wait until there is a master."""
        until = time.monotonic() + PATIENCE
        while not answers(self.uri):
            assert time.monotonic() < until, "no master answers"
            time.sleep(0.05)

    def start(self, command: Sequence[str | Path], **environment: str) -> subprocess.Popen[str]:
        """Start a process in a session of its own; its output goes to pipes."""
        process = subprocess.Popen(
            [str(part) for part in command],
            cwd=ROOT,
            env={**self.environment, **environment},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        self.processes.append(process)
        return process

    def session(self, config: Path, *options: str | Path) -> subprocess.Popen[str]:
        """Start `dubins-traffic ros1 run`."""
        command = [sys.executable, "-m", "dubins_traffic.cli", "ros1", "run", config, "--json", *options]
        return self.start(command)

    def client(self, *actions: str) -> subprocess.Popen[str]:
        """Start the client of tests/ros_client.py."""
        generated = self.client_messages()
        return self.start([SYSTEM_PYTHON, ROOT / "tests" / "ros_client.py", *actions], PYTHONPATH=str(generated))

    def world(self, fault: str = "none", cars: Sequence[str] = CARS) -> subprocess.Popen[str]:
        """Start the world of tests/ros_world.py, by default with the ego and a car `agent0`."""
        generated = self.client_messages()
        return self.start([SYSTEM_PYTHON, ROOT / "tests" / "ros_world.py", fault, *cars], PYTHONPATH=str(generated))

    def client_messages(self) -> Path:
        """Return where our messages are for the system's Python."""
        generated = self.folder / "messages"
        if not generated.is_dir():
            write_python(generated)
        return generated

    def close(self) -> None:
        """End everything that was started here, by its own session."""
        for process in reversed(self.processes):
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGCONT)
                os.killpg(process.pid, signal.SIGTERM)
        for process in self.processes:
            try:
                process.communicate(timeout=30)
            except subprocess.TimeoutExpired:
                process.kill()
                process.communicate()


@contextmanager
def graph(folder: Path, *, core: bool = True) -> Iterator[Graph]:
    """A graph that is closed at the end."""
    made = Graph(folder)
    try:
        if core:
            made.roscore()
        yield made
    finally:
        made.close()


def read_until(process: subprocess.Popen[str], pattern: str) -> str:
    """Return what a process has said on standard error when that fits; it fails if the process ends before."""
    assert process.stderr is not None
    said = ""
    watchdog = threading.Timer(PATIENCE, process.kill)
    watchdog.start()
    try:
        for line in process.stderr:
            said += line
            if re.search(pattern, line):
                return said
    finally:
        watchdog.cancel()
    raise AssertionError(f"it never said {pattern!r} but {said!r}")


def finish(process: subprocess.Popen[str], seconds: float = PATIENCE) -> tuple[int, str, str]:
    """Wait for `process` and return its status, output and errors."""
    out, err = process.communicate(timeout=seconds)
    return process.returncode, out, err


def lines(text: str) -> list[dict[str, Any]]:
    """Return the JSON objects in `text`, one a line."""
    return [json.loads(line) for line in text.splitlines() if line.startswith("{")]


def configuration(folder: Path, **more: Any) -> Path:
    """Write a small configuration and return its path."""
    document = {
        "version": 1,
        "problem_domain": "dubins_traffic",
        "rnd": {"version": 0, "length": 3, "transform": [0, 0, 0], "shape": [3, 4]},
        "e-agents": [{"type": "wander", "name": "agent", "count": 2}],
        "number_trials": 3,
        "duration": 2.0,
        **more,
    }
    path = folder / "config.json"
    path.write_text(json.dumps(document))
    return path
