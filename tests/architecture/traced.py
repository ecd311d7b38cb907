"""A call of the package, traced: which rooms it enters, by which functions, and where a lower room calls a higher one.

``python -m tests.architecture.traced CALL FOLDER`` prints it as JSON, of one of `CALLS`.
"""

from __future__ import annotations

import contextlib
import json
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from inspect import CO_OPTIMIZED
from pathlib import Path
from types import FrameType

from tests.architecture.buildings import Town, town
from tests.architecture.house import PACKAGE

PASSING = ("kernels.compile", "kernels.calls", "compiling.beside")
"""Modules that call a kernel for whoever wants it, or see that it is compiled: what they call is called by that."""


@dataclass
class Trace:
    """What a call did.

    Attributes
    ----------
    entered : Counter
        How often each room was entered from another, by room and the function that was called.
    upward : Counter
        How often a function called one of a higher room: names of both.
    """

    entered: Counter[tuple[str, str]] = field(default_factory=Counter)
    upward: Counter[tuple[str, str]] = field(default_factory=Counter)

    def modules(self) -> dict[str, list[str]]:
        """Return the modules by which each room was entered."""
        found: dict[str, set[str]] = {}
        for room, function in self.entered:
            found.setdefault(room, set()).add(function.split(".")[1])
        return {room: sorted(names) for room, names in sorted(found.items())}

    def returns(self) -> list[str]:
        """Return the pairs of rooms of which the lower one calls the higher one, each with a call."""
        found = {tuple(name.partition(".")[0] for name in pair): " -> ".join(pair) for pair in sorted(self.upward)}
        return sorted(found.values())


def traced(call: Callable[[], object]) -> Trace:
    """Return what a call does in this thread."""
    found, house = Trace(), town()

    def note(frame: FrameType, event: str, _argument: object) -> None:
        if event != "call":
            return
        called = _module(frame)
        if called is None or called in PASSING:
            return
        caller = frame.f_back
        while caller is not None and _module(caller) in (None, *PASSING):
            caller = caller.f_back
        if caller is not None:
            _take(found, house, (_module(caller) or "", caller), (called, frame))

    sys.setprofile(note)
    try:
        call()
    finally:
        sys.setprofile(None)
    return found


def _take(found: Trace, house: Town, caller: tuple[str, FrameType], called: tuple[str, FrameType]) -> None:
    """Take a call between two functions of the package."""
    room, theirs = (module.partition(".")[0] for module, _ in (caller, called))
    if room == theirs or not {room, theirs} <= house.building.keys():
        return
    names = tuple(f"{module}.{frame.f_code.co_qualname}" for module, frame in (caller, called))
    found.entered[theirs, names[1]] += 1
    if not house.may_know(room, theirs):
        found.upward[names[0], names[1]] += 1


def _module(frame: FrameType) -> str | None:
    """Return the module of a frame below the package; None of code elsewhere, and of bodies of modules and classes."""
    code = frame.f_code
    if not code.co_flags & CO_OPTIMIZED or not code.co_filename.startswith(str(PACKAGE)):
        return None
    known = _names.get(code.co_filename)
    if known is None:
        parts = Path(code.co_filename).relative_to(PACKAGE).with_suffix("").parts
        known = _names[code.co_filename] = ".".join(part for part in parts if part != "__init__")
    return known


_names: dict[str, str] = {}


def _batch(folder: Path) -> None:
    import dubins_traffic as dt

    dt.run_batch(str(folder / "short.json"), "lanes", trials=2, seed=3)


def _trial(folder: Path) -> None:
    import dubins_traffic as dt

    dt.run_trial(dt.draw(dt.load_config(str(folder / "short.json")), seed=1, trial=0), "lanes")


def _run(folder: Path) -> None:
    from dubins_traffic.cli.__main__ import main as command

    sys.argv = ["dubins-traffic", "run", str(folder / "short.json"), "--controller", "lanes", "--trials", "1"]
    with contextlib.suppress(SystemExit), contextlib.redirect_stdout(sys.stderr):
        command()


CALLS = {"run_batch": _batch, "run_trial": _trial, "run": _run}
"""The calls that are traced: two functions of the package and a command, of one short configuration each."""


def main() -> int:
    """Trace the call that the command line names, and print what it did."""
    name, folder = sys.argv[1], Path(sys.argv[2])
    trace = traced(lambda: CALLS[name](folder))
    print(json.dumps({"modules": trace.modules(), "returns": trace.returns()}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
