"""Files that pages take for granted, and what must be installed for them."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from json import dumps
from pathlib import Path
from typing import Any

import dubins_traffic as dt
from dubins_traffic.problem.document import instance_to_document
from tests import boxes, gazebo
from tests.shown import ROOT
from tests.tools import sumo_program

DRIVER = "class {}:\n    def start(self, problem): ...\n    def act(self, observation): return 0.1, 0.0\n"
SHORT: dict[str, Any] = {
    "version": 0,
    "problem_domain": "dubins_traffic",
    "rnd": {"version": 0, "length": 3, "transform": [0, 0, 0], "shape": [3, 4]},
    "e-agents": [{"type": "wander/wander", "name": "agent0"}, {"type": "wander/wander", "name": "agent1"}],
    "number_trials": 1,
    "duration_bounds": [2, 2],
    "number_goals_bounds": [1, 3],
}
"""The shipped configuration `demo` with one trial of two seconds. A file `demo` is read before the shipped one."""
SQUARE = {
    "version": 1,
    "problem_domain": "dubins_traffic",
    "rnd": {"version": 0, "length": 6, "transform": [0, 0, 0], "shape": [2, 2]},
    "e-agents": [{"type": "lawful", "name": "car"}],
    "goals": [[0, 0], [1, 1]],
    "duration": 20,
    "rules": True,
}

FLOOR = {
    **SQUARE,
    "rnd": {**SHORT["rnd"]},
    "e-agents": [{"type": "scripted", "name": "agent0", "parameters": {"commands": [[9, 0.2, 0.0]]}}],
    "goals": [[0, 0], [1, 0]],
    "rules": False,
    "duration": 2,
    "number_trials": 1,
}


def short_demo(folder: Path) -> None:
    (folder / "demo").write_text(dumps(SHORT))


def clone(*parts: str) -> Callable[[Path], None]:
    """Return what puts parts of the repository into a folder."""

    def put(folder: Path) -> None:
        for part in parts:
            where = folder / part
            where.parent.mkdir(parents=True, exist_ok=True)
            if (ROOT / part).is_dir():
                shutil.copytree(ROOT / part, where, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                shutil.copy(ROOT / part, where)

    return put


def recorded(configuration: str = "town", seed: int = 0, **options: Any) -> Callable[[Path], None]:
    """Return what makes a record and the instance of it."""

    def put(folder: Path) -> None:
        (folder / "out").mkdir()
        instance = dt.draw(dt.load_config(configuration), seed, 0)
        dt.run_trial(instance, "lanes", record=folder / "out" / "trial-0000.mcap", **options)
        (folder / "instance.json").write_text(dumps(instance_to_document(instance)))

    return put


def files(**texts: str) -> Callable[[Path], None]:
    """Return what writes files, whose names have ``__`` for the dot."""

    def put(folder: Path) -> None:
        for name, text in texts.items():
            (folder / name.replace("__", ".")).write_text(text)

    return put


def file_of(path: str) -> Callable[[Path], None]:
    """Return what puts one file of the repository into a folder."""
    return lambda folder: shutil.copy(ROOT / path, folder)


def need_boxes() -> None:
    """Skip the test where programs of strangers can't be held; under CI it fails."""
    boxes.need()


def towns() -> Path:
    """Return the towns that come with SUMO; skip the test, or fail it under CI, where it is not installed."""
    return Path(sumo_program("sumo")).parents[1] / "tools" / "game"


def need_gazebo() -> None:
    gazebo.installation()


def need_sumo() -> None:
    towns()
