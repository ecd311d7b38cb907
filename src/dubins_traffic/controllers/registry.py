"""Ego controllers by name: those that come with the package, and a user's own."""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable, Mapping
from typing import cast

from dubins_traffic import outside
from dubins_traffic.cars.state import Observation
from dubins_traffic.controllers import blame
from dubins_traffic.errors import InputError
from dubins_traffic.outside import ConstructionError, Seam
from dubins_traffic.problem.instance import Problem
from dubins_traffic.protocols import Controller

_BUILT_IN = {
    "keyboard": ("dubins_traffic.controllers.keyboard", "Keyboard"),
    "lanes": ("dubins_traffic.controllers.lanes", "Lanes"),
    "rules": ("dubins_traffic.controllers.rules", "Rules"),
    "simple": ("dubins_traffic.controllers.simple", "Simple"),
    "synthesized": ("dubins_traffic.controllers.synthesized", "Synthesized"),
}
_DESCRIPTIONS = {
    "keyboard": "you, with the arrow keys, in real time; the map is drawn in the terminal",
    "lanes": "shortest route through the goals in the right lane; follows cars, waits at occupied intersections",
    "rules": "round the goals under all rules of the road: right lane, stops, order of arrival, never at fault",
    "simple": "the reference of 2016: round the goals in order, straight across country, blind to cars",
    "synthesized": "plays a winning strategy of the game of cells, found at the start; drives as rules does",
}
COMPILED = "rules"
"""The controller that is compiled: in a batch no Python runs between two ticks of its trials."""
SHIELDED = "+shield"
"""What ends the name of a controller that drives under the shield (`controllers.shield`); behind it there may be a
colon and when the ego may overtake, as in ``lanes+shield:never``."""
_SHIELD = re.compile(re.escape(SHIELDED) + r"(?::(?P<overtakes>\w*))?$")
SANDBOXED = "+sandbox"
"""What ends the name of a controller that drives in a box (`dubins_traffic.sandbox`), before that of a shield; behind
it there may be limits, as in ``my.py:Mine+sandbox,memory=512M``."""
_SANDBOX = re.compile(re.escape(SANDBOXED) + r"(?P<limits>(?:,[\w=.+-]*)*)$")
_SEAM = Seam(
    "--controller",
    "controller",
    ("start", "act"),
    "start(problem) and act(observation) -> (speed, yaw rate)",
    blame.error_text,
)
_EXPECTED = "a built-in name ({}), module:Class or path/to/file.py:Class"


class Unmade:
    """In place of a controller that could not be made: its trial ends as the fault that this was."""

    def __init__(self, cause: BaseException) -> None:
        self._cause = cause

    def start(self, problem: Problem) -> None:  # noqa: ARG002  # it never comes to drive
        """Raise what making the controller raised."""
        raise self._cause

    def act(self, observation: Observation) -> None:
        """Give up; no trial comes as far as this."""


def made(make: Callable[[], Controller]) -> Controller:
    """Return the controller that `make` makes, for one trial; if that raises, one whose trial ends as its fault.

    Raises
    ------
    InputError
        If there is no such controller, which is no trial's fault.
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
    return dict(_DESCRIPTIONS)


def load(spec: str) -> Controller:
    """Return a new controller.

    Parameters
    ----------
    spec : str
        A built-in name, ``module:Class`` or ``path/to/file.py:Class``. Modules are also looked up in the current
        directory; a file may import its neighbours. Of a record, ``NAME.mcap``, the ego's commands are played again; a
        strategy that `dubins-traffic synth` has saved, ``NAME.npz``, is played by `synthesized`. Followed by
        ``+shield``: the same under the shield; by ``+shield:law`` or ``+shield:never`` under one that overtakes
        otherwise (`controllers.shield.Shield`). Followed by ``+sandbox``: the same in a box (`dubins_traffic.sandbox`).

    Raises
    ------
    InputError
        If there is no such name, module, file or class, if the code raises while it is loaded or constructed (then a
        `ConstructionError`), or if the object lacks a method of `dubins_traffic.protocols.Controller`. Whatever it
        raises counts, `SystemExit` too; only Ctrl-C goes through.
    """
    if is_shielded(spec):
        return under_shield(load(_SHIELD.sub("", spec)), spec)
    boxed = _SANDBOX.search(spec)
    if boxed is not None:
        module = importlib.import_module("dubins_traffic.sandbox.controller")
        return cast(Controller, module.named(spec[: boxed.start()], boxed["limits"].lstrip(",")))
    if spec in _BUILT_IN:
        module, name = _BUILT_IN[spec]
        return cast(Controller, getattr(importlib.import_module(module), name)())
    if spec.endswith(".mcap"):
        return cast(Controller, importlib.import_module("dubins_traffic.controllers.scripted").replay(spec))
    if spec.endswith(".npz"):
        return cast(
            Controller, importlib.import_module("dubins_traffic.controllers.synthesized").player(spec)
        )
    if not outside.is_place(spec):
        raise _SEAM.refuse("unknown controller", spec, _EXPECTED.format(", ".join(sorted(_BUILT_IN))))
    return cast(Controller, outside.make(outside.find(spec, _SEAM), spec, _SEAM))


def is_shielded(spec: str) -> bool:
    """Tell whether a name is that of a controller under the shield."""
    return _SHIELD.search(spec) is not None


def shielded(spec: str) -> str:
    """Return the name of a controller under the shield."""
    return spec if is_shielded(spec) else spec + SHIELDED


def sandboxed(spec: str, limits: str = "") -> str:
    """Return the name of a controller in a box, which is inside its shield if it has one.

    Parameters
    ----------
    spec : str
        Its name.
    limits : str
        What it may use, as ``memory=512M,bank_seconds=10``.
    """
    shield = _SHIELD.search(spec)
    bare, ending = (spec, "") if shield is None else (spec[: shield.start()], shield[0])
    if _SANDBOX.search(bare) is None:
        bare += SANDBOXED + (f",{limits}" if limits else "")
    return bare + ending


def dressed(spec: str, *, shield: bool = False, sandbox: str | None = None) -> str:
    """Return the name of a controller in a box unless `sandbox` is None, and under the shield if `shield`."""
    boxed = spec if sandbox is None else sandboxed(spec, sandbox)
    return shielded(boxed) if shield else boxed


def under_shield(controller: Controller, spec: str = SHIELDED) -> Controller:
    """Return a controller that drives as `controller` does under the shield that a name `spec` ends in.

    Raises
    ------
    InputError
        If there is no such shield.
    """
    ending = _SHIELD.search(spec)
    given = None if ending is None else ending["overtakes"]
    more = {} if given is None else {"overtakes": given}
    shield = importlib.import_module("dubins_traffic.controllers.shield").Shield
    return cast(Controller, shield(controller, **more))
