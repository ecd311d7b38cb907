"""What tests of boxes share: whether this machine makes boxes, and controllers that misbehave."""

from __future__ import annotations

from pathlib import Path

import pytest

import dubins_traffic as dt
from dubins_traffic.sandbox import BoxedController, Limits, available_layers, boxed_controller
from tests import tools
from tests.recordings import make_instance

needs_boxes = pytest.mark.tools("boxes")


def need() -> None:
    """Skip the test where programs of strangers can't be held; under CI it fails."""
    tools.need("; ".join(available_layers().missing()), "docs/sandbox.md says what boxes are made of")


HEAD = """
import os, sys, time, ctypes, socket, subprocess, threading
"""


def written(folder: Path, body: str, name: str = "mine.py") -> str:
    """Write a controller whose `act` has `body`, and return its name."""
    lines = "\n".join(f"        {line}" for line in body.strip().splitlines())
    text = f"{HEAD}\nclass Mine:\n    def start(self, problem):\n        self.problem = problem\n"
    (folder / name).write_text(f"{text}    def act(self, seen):\n{lines}\n")
    return f"{folder / name}:Mine"


def driven(
    spec: str, limits: Limits | None = None, *, ticks: int = 30, agents: tuple[str, ...] = ("agent0",)
) -> tuple[dt.Result, BoxedController]:
    """Run a trial with a controller in a box."""
    controller = boxed_controller(spec, limits)
    return dt.run_trial(make_instance(names=agents, ticks=ticks), controller), controller
