"""Controllers by name, without a shield: those that come with the package, and a user's own."""

from __future__ import annotations

import importlib
import re
from typing import Any, Final, cast

from dubins_traffic import outside
from dubins_traffic.above import ABOVE
from dubins_traffic.controllers import blame
from dubins_traffic.files import begins_with, is_file
from dubins_traffic.outside import Seam
from dubins_traffic.protocols import Controller

BUILT_IN: Final = {
    "lanes": (
        "Lanes",
        "shortest route through the goals in the right lane; follows cars, waits at occupied intersections",
    ),
    "rules": (
        "Rules",
        "round the goals under all rules of the road: right lane, stops, order of arrival, never at fault",
    ),
    "simple": (
        "Simple",
        "the reference of 2016: round the goals in order, straight across country, blind to cars",
    ),
    "synthesized": (
        "Synthesized",
        "plays a winning strategy of the game of cells, found at the start; drives as rules does",
    ),
}
"""Class and description of each controller that comes with the package, by the name of its module."""
SANDBOXED: Final = "+sandbox"
"""Suffix of the name of a controller that drives in a box (`dubins_traffic.sandbox`); it precedes that of a shield,
and limits may follow it, as in ``my.py:Mine+sandbox,memory=512M``."""
SANDBOX: Final = re.compile(re.escape(SANDBOXED) + r"(?P<limits>(?:,[\w=.+-]*)*)$")
FALLBACK: Final = "+fallback"
"""Suffix of the file of a strategy of another tool with which the ego goes on by the rules where the strategy begins
elsewhere, or makes no move of the game."""
CLASS_FIRST: Final = b"class TulipStrategy"
"""Text by which a strategy that TuLiP has written in Python is known; the file is parsed, not run."""
_SEAM = Seam(
    "--controller",
    "controller",
    ("start", "act"),
    "start(problem) and act(observation) -> (speed, yaw rate)",
    blame.error_text,
)
_EXPECTED = "a built-in name ({}), module:Class or path/to/file.py:Class"


def load(spec: str) -> Controller:
    """Return a new controller, as `controllers.registry.load` does for names without a shield."""
    boxed = SANDBOX.search(spec)
    if boxed is not None:
        return cast(Controller, ABOVE.boxed(spec[: boxed.start()], boxed["limits"].lstrip(",")))
    if spec in BUILT_IN:
        return cast(Controller, getattr(_module(spec), BUILT_IN[spec][0])())
    if spec.endswith(".mcap"):
        return cast(Controller, _module("scripted").replay(spec))
    if spec.endswith(".npz"):
        learned = _module("learned")
        return cast(Controller, (learned if learned.is_policy(spec) else _module("synthesized")).player(spec))
    if spec.endswith(".onnx"):
        return cast(Controller, ABOVE.boxed(spec, ""))
    if (file := foreign(spec)) is not None:
        return cast(Controller, _module("synthesized").foreign_player(file, fallback=file != spec))
    if not outside.is_place(spec):
        raise _SEAM.refuse("unknown controller", spec, _EXPECTED.format(", ".join(BUILT_IN)))
    return cast(Controller, outside.make(outside.find(spec, _SEAM), spec, _SEAM))


def foreign(spec: str) -> str | None:
    """Return the file of the strategy of another tool that a name stands for, None for any other controller."""
    if spec.endswith((".mcap", ".npz", ".onnx")):
        return None
    file = spec if is_file(spec) else spec.removesuffix(FALLBACK)
    plays = is_file(file) and (not file.endswith(".py") or begins_with(file, CLASS_FIRST))
    return file if plays else None


def _module(name: str) -> Any:
    above = ABOVE.parts("controllers")
    return above[name]() if name in above else importlib.import_module(f"dubins_traffic.controllers.{name}")
