"""Faults and collisions that end a trial early: the check of a command, and the details of endings."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, cast

import numpy as np

from dubins_traffic.cars.state import EGO, Command, Contact
from dubins_traffic.controllers.blame import value_text
from dubins_traffic.errors import ControllerError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.record.sink import End

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance


def checked_command(command: object, tick: int) -> tuple[float, float]:
    """Return the command of a controller at `tick` as two finite numbers (m/s, rad/s).

    Raises
    ------
    ControllerError
        If `command` is anything else: a controller fault.
    """
    try:
        speed, yaw = _pair(command)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a user's object may raise anything when it is converted to a number
        detail = f"a command is two numbers (speed, yaw rate): got {value_text(command, 80)} at tick {tick}"
        raise ControllerError(End.CONTROLLER_FAULT.value, detail) from error
    if not (math.isfinite(speed) and math.isfinite(yaw)):
        detail = f"a command is two finite numbers: got ({speed}, {yaw}) at tick {tick}"
        raise ControllerError(End.CONTROLLER_FAULT.value, detail)
    return speed, yaw


def _pair(command: object) -> tuple[float, float]:
    """Return a sequence of two numbers as floats.

    Raises TypeError if it is no such sequence, and whatever converting its elements raises.
    """
    if type(command) not in (tuple, Command) and not _is_row(command):
        raise TypeError("not a row")
    speed, yaw = cast("tuple[float, float]", command)
    return _number(speed), _number(yaw)


def _is_row(value: object) -> bool:
    """Tell whether a value has an order and a length: no generator, set, mapping or text."""
    ordered = hasattr(value, "__getitem__") and hasattr(value, "__len__")
    return ordered and not isinstance(value, str | bytes | bytearray | Mapping)


def _number(value: object) -> float:
    if type(value) is float:
        return value
    if isinstance(value, str | bytes | bytearray) or getattr(value, "shape", ()) != ():
        raise TypeError("not a number")
    return float(cast("float", value))


def agent_fault(instance: Instance, commands: Floats) -> str:
    """Return the detail of the ending `agent_fault`: which e-agent's row of `commands` (N, 2) is not finite."""
    n = int(np.argwhere(~np.isfinite(commands).all(axis=1))[0, 0])
    return f"{instance.names[n]} asked for a command that is not finite"


def collision_detail(instance: Instance, contact: Contact) -> str:
    """Return the detail of the ending `collision`: with whom the ego collided, and when."""
    other = contact.other if contact.car == EGO else contact.car
    name = instance.names[other] if other >= 0 else f"obstacle {-1 - other}"
    return f"with {name} at {contact.time:.3f} s"
