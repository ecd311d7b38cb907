"""Trials of every sort that can be forked, and what they have come to, to the bit."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np

from dubins_traffic.cars.state import Frames
from dubins_traffic.problem.configuration import Configuration, load_config
from dubins_traffic.problem.instance import Instance, Problem
from dubins_traffic.protocols import Ending
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.scoring.score import Score

KINDS: tuple[Mapping[str, Any], ...] = (
    {"type": "lawful", "name": "agent", "count": 2},
    {
        "type": "lawful",
        "name": "rogue",
        "parameters": {"rolls": 0.5, "left": 0.4, "tailgates": 0.5, "parks": 0.4},
    },
    {"type": "nemesis", "name": "nemesis"},
    {"type": "wander", "name": "walker", "count": 2},
    {"type": "loop", "name": "bus"},
    {"type": "follow", "name": "tail", "count": 2},
    {"type": "parked", "name": "parked", "parameters": {"vacates_after": 1.0}},
    {"type": "scripted", "name": "script", "parameters": {"commands": [[1.0, 0.3, 0.4]], "repeat": True}},
    {"type": "free", "name": "free", "count": 2},
)
"""E-agents of every kind that drives beside others."""
WORLDS: Mapping[str, Mapping[str, Any]] = {
    "plain": {},
    "noise": {"disturbances": {"position_noise": 0.02, "heading_noise": 0.01}},
    "lossy": {"disturbances": {"command_delay": 3, "command_loss": 0.4}},
    "obstacle": {"obstacles": [{"disc": {"x": 4.0, "y": 0.3, "radius": 0.2}}]},
    "rectangles": {"car": {"w": 0.3, "body": {"rectangle": {"length": 0.45, "width": 0.3}}}},
    "laser": {"laser": True},
    "formulas": {"formulas": {"untouched": "[] !collision_ego", "back": "[] (left_ego -> <>[0,1] !left_ego)"}},
}
"""What a trial may have beside."""


def configuration(kinds: Mapping[str, Any] | Any, world: str, rules: bool, seconds: int = 3) -> Configuration:
    """Return a configuration with these e-agents in one of `WORLDS`."""
    document = {
        "version": 1,
        "problem_domain": "dubins_traffic",
        "network": {"grid": {"rows": 3, "columns": 3, "length": 4.0}},
        "rules": {
            "linger_time": 0.5,
            "rest_time": 0.2,
            "journey_start_time": 0.2,
            "exit_time": 4.0,
            "enter_time": 0.4,
            "forfeit_time": 0.5,
        }
        if rules
        else False,
        "e-agents": list(kinds),
        "number_trials": 1,
        "number_goals_bounds": [1, 3],
        "duration_bounds": [seconds, seconds],
        **WORLDS[world],
    }
    return load_config(document)


class Kept:
    """A sink that keeps all it is given, and goes on in forks."""

    forks = True

    def __init__(self) -> None:
        self.blocks: list[Frames] = []
        self.ending: Ending | None = None

    def begin(self, instance: Instance) -> None:
        self.instance = instance

    def frames(self, frames: Frames) -> None:
        self.blocks.append(frames)

    def end(self, ending: Ending) -> None:
        self.ending = ending

    def told(self) -> list[Any]:
        """Return all of it, arrays as bytes."""
        names = Frames.__dataclass_fields__
        return [
            self.ending,
            *(
                value.tobytes() if hasattr(value, "tobytes") else value
                for block in self.blocks
                for value in (getattr(block, name) for name in names)
            ),
        ]


def plain(found: Score) -> Mapping[str, Any]:
    """Return what of a score is no matter of clocks and places."""
    return {
        name: value
        for name, value in found.to_json().items()
        if name not in ("time_to_begin_s", "record", "controller", "ran")
    }


def arrays_in(value: Any, name: str = "", seen: set[int] | None = None) -> dict[str, np.ndarray]:
    """Return the arrays that an object holds, itself or by what it holds, but for those of values that never change."""
    seen = set() if seen is None else seen
    if id(value) in seen or isinstance(value, Instance | Problem | RoadNetwork | str | type):
        return {}
    seen.add(id(value))
    if isinstance(value, np.ndarray):
        return {name: value}
    if isinstance(value, Mapping):
        parts = {str(key): part for key, part in value.items()}
    elif hasattr(value, "_asdict"):
        parts = value._asdict()
    elif isinstance(value, list | tuple | deque):
        parts = {str(k): part for k, part in enumerate(value)}
    else:
        slots = [slot for kind in type(value).__mro__ for slot in getattr(kind, "__slots__", ())]
        parts = {
            **getattr(value, "__dict__", {}),
            **{s: getattr(value, s) for s in slots if hasattr(value, s)},
        }
    found: dict[str, np.ndarray] = {}
    for key, part in parts.items():
        if key in (
            "description",
            "pose_rows",
            "label_rows",
        ):  # places of arrays, and views of some
            continue
        found |= arrays_in(part, f"{name}.{key}", seen)
    return found
