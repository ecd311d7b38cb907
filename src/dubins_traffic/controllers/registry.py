"""Finds ego controllers by name, with or without shield and box."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, cast

from dubins_traffic.cars.state import Observation
from dubins_traffic.controllers import named
from dubins_traffic.errors import InputError
from dubins_traffic.outside import ConstructionError
from dubins_traffic.problem.instance import Problem
from dubins_traffic.protocols import Controller

if TYPE_CHECKING:
    from dubins_traffic.shield.tables import Overtakes

IN_PROCESS, BOXED, TRUSTED, ELSEWHERE = "in process", "boxed", "trusted", "elsewhere"
"""Where a controller ran: in this process, which trusts it; in a box; told to be trusted, with the limits that the
machine has; as a program at the other end of a transport."""
TRANSPORTS = frozenset({"ros1", "ros2", "lcm", "lines", "stdio"})
"""What a driver at the other end of a transport is called."""
COMPILED = "rules"
"""The compiled controller: in a batch no Python runs between two ticks of its trials."""
SHIELDED = "+shield"
"""Suffix of the name of a controller that drives under the shield (`controllers.shield`); a colon and when the ego may
overtake may follow it, as in ``lanes+shield:never``."""
USUAL = "sure"
"""When a shield overtakes whose name does not say it."""
_SHIELD = re.compile(re.escape(SHIELDED) + r"(?::(?P<overtakes>\w*))?$")


class Unmade:
    """Stands for a controller that could not be made: its trial ends with that error as its fault."""

    def __init__(self, cause: BaseException) -> None:
        self._cause = cause

    def start(self, problem: Problem) -> None:  # noqa: ARG002  # it never comes to drive
        """Raise the error of making the controller."""
        raise self._cause

    def act(self, observation: Observation) -> None:
        """Give up; never called, since `start` raises."""


def made(make: Callable[[], Controller]) -> Controller:
    """Return the controller that `make` returns; if it raises, an `Unmade` whose trial ends with that fault.

    Raises
    ------
    InputError
        If there is no such controller: that is not a fault in one trial.
    """
    try:
        return make()
    except KeyboardInterrupt:
        raise
    except ConstructionError as error:
        return Unmade(error.__cause__ or error)
    except InputError:
        raise
    except BaseException as error:
        return Unmade(error)


def names() -> Mapping[str, str]:
    """Return the built-in controllers: name to one line of description."""
    return {name: text for name, (_, text) in named.BUILT_IN.items()}


def load(spec: str) -> Controller:
    """Return a new controller.

    Parameters
    ----------
    spec : str
        A built-in name, ``module:Class`` or ``path/to/file.py:Class``. Modules are also looked up in the current
        directory; a file may import its neighbours. A record, ``NAME.mcap``, replays the ego's commands. A strategy
        that `dubins-traffic synth` has saved, ``NAME.npz``, or one of another tool (`synthesis.foreign`), told by the
        content of its file, is played by `synthesized`; with the suffix ``+fallback`` the ego goes on by the rules
        where that strategy makes no move of the game. A policy of `learning.policy`, ``NAME.npz``, drives, and one
        in ONNX, ``NAME.onnx``, in a box. With the suffix ``+shield`` it drives under the shield, with ``+shield:law``
        or ``+shield:never`` under one with another rule for overtaking (`controllers.shield.Shield`); with
        ``+sandbox`` it drives in a box (`dubins_traffic.sandbox`).

    Raises
    ------
    InputError
        If there is no such name, module, file or class; if the code raises anything, even SystemExit, while it is
        loaded or constructed (then a `ConstructionError`); or if the object lacks a method of
        `dubins_traffic.protocols.Controller`. Only Ctrl-C passes through.
    """
    shield = shield_of(spec)
    return named.load(spec) if shield is None else under_shield(load(shield[0]), spec)


def is_shielded(spec: str) -> bool:
    """Tell whether a name is that of a controller under the shield."""
    return _SHIELD.search(spec) is not None


def shield_of(spec: str) -> tuple[str, str] | None:
    """Split a name into that of the controller under the shield and when that overtakes; None without a shield."""
    match = _SHIELD.search(spec)
    if match is None:
        return None
    return spec[: match.start()], USUAL if match["overtakes"] is None else match["overtakes"]


def shielded(spec: str) -> str:
    """Return the name of a controller under the shield."""
    return spec if is_shielded(spec) else spec + SHIELDED


def plays_foreign(spec: str) -> bool:
    """Tell whether a name stands for a strategy of another tool, with or without a shield."""
    return named.foreign(_SHIELD.sub("", spec)) is not None


def sandboxed(spec: str, limits: str = "") -> str:
    """Return the name of the same controller in a box; a shield stays outside the box.

    Parameters
    ----------
    spec : str
        Name of the controller.
    limits : str
        Limits of the box, as ``memory=512M,bank_seconds=10``.
    """
    shield = _SHIELD.search(spec)
    bare, ending = (spec, "") if shield is None else (spec[: shield.start()], shield[0])
    if named.SANDBOX.search(bare) is None:
        bare += named.SANDBOXED + (f",{limits}" if limits else "")
    return bare + ending


def ran(name: str | None) -> str | None:
    """Return where a controller of that name ran, of IN_PROCESS, BOXED, TRUSTED, ELSEWHERE; None without a name."""
    bare = _SHIELD.sub("", name or "")
    box = named.SANDBOX.search(bare)
    if box is not None:
        return TRUSTED if "trust" in box["limits"].split(",") else BOXED
    if bare in TRANSPORTS:
        return ELSEWHERE
    if bare.endswith(".onnx"):
        return BOXED
    return IN_PROCESS if bare else None


def is_ours(spec: str) -> bool:
    """Tell whether our code alone drives: a built-in controller, a record, or a strategy or policy in a file."""
    bare = _SHIELD.sub("", spec)
    data = bare.endswith((".mcap", ".npz")) or named.foreign(bare) is not None
    return bare in named.BUILT_IN or data or bare.startswith("dubins_traffic.")


def dressed(spec: str, *, shield: bool = False, sandbox: str | None = None) -> str:
    """Return the name of a controller in a box unless `sandbox` is None, and under the shield if `shield`."""
    boxed = spec if sandbox is None else sandboxed(spec, sandbox)
    return shielded(boxed) if shield else boxed


def under_shield(controller: Controller, spec: str = SHIELDED) -> Controller:
    """Return `controller` under the shield that the suffix of the name `spec` describes, the usual one without any.

    Raises
    ------
    InputError
        If there is no such shield.
    """
    from dubins_traffic.controllers.shield import Shield

    _, overtakes = shield_of(spec) or (spec, USUAL)
    return Shield(controller, overtakes=cast("Overtakes", overtakes))
