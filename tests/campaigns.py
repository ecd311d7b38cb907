"""Small campaigns for tests, and the command that runs them."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

COMMAND = str(Path(sys.executable).with_name("dubins-traffic"))

CONTROLLERS = """
import os, signal
from pathlib import Path

LOG = Path(__file__).with_name("log")


class Logged:
    \"\"\"Notes every trial that it is started in.\"\"\"

    def start(self, problem):
        with LOG.open("a") as log:
            log.write(f"{os.getpid()}\\n")

    def act(self, observation):
        return (0.3, 0.1)


class Faulty:
    \"\"\"Raises where there is one goal, kills its process where there are three.\"\"\"

    def start(self, problem):
        self.goals = len(problem.goals)

    def act(self, observation):
        if observation.tick == 5 and self.goals == 1:
            raise ValueError("one goal is not enough")
        if observation.tick == 5 and self.goals == 3:
            os.kill(os.getpid(), signal.SIGKILL)
        return (0.3, 0.1)


class Slow(Logged):
    \"\"\"Takes three thousandths of a second for each answer.\"\"\"

    def act(self, observation):
        import time
        time.sleep(0.003)
        return (0.3, 0.1)
"""


def campaign(**changes: Any) -> dict[str, Any]:
    """Return the document of a campaign of two controllers and four cells, with `changes`."""
    document: dict[str, Any] = {
        "version": 0,
        "name": "small",
        "seed": 5,
        "trials": 8,
        "controllers": ["controllers.py:Logged", "simple"],
        "configurations": ["demo"],
        "factors": {"e_agents": [0, 2], "duration": [1.0, 2.0]},
        "chunk": 3,
    }
    return {**document, **changes}


def written(folder: Path, document: dict[str, Any]) -> Path:
    """Write a campaign file and its controllers into `folder`, and return the file."""
    (folder / "controllers.py").write_text(CONTROLLERS)
    path = folder / "campaign.toml"
    path.write_text("".join(f"{key} = {_toml(value)}\n" for key, value in document.items()))
    return path


def logged(folder: Path) -> int:
    """Return how many trials `Logged` has begun."""
    log = folder / "log"
    return len(log.read_text().splitlines()) if log.exists() else 0


def command(file: Path, folder: Path, *options: str) -> list[str]:
    """Return the command that runs a campaign."""
    return [COMMAND, "campaign", "run", str(file), "-o", str(folder), *options]


def run(file: Path, folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
    """Run a campaign to its end."""
    return subprocess.run(command(file, folder, *options), check=False, capture_output=True, text=True, timeout=600)


def succeed(file: Path, folder: Path, *options: str) -> bytes:
    """Run a campaign that ends well and return the bytes of its table."""
    done = run(file, folder, *options)
    assert done.returncode == 0, done.stderr
    return (folder / "results.parquet").read_bytes()


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, dict):
        return "{" + ", ".join(f'"{key}" = {_toml(item)}' for key, item in value.items()) + "}"
    if isinstance(value, Sequence):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return repr(value)
