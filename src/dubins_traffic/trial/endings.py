"""What ends a trial early, and what is said of it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, cast

import numpy as np

from dubins_traffic.cars.state import EGO, Contact
from dubins_traffic.errors import ControllerError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.record.sink import End

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance


def checked_command(command: object, tick: int) -> tuple[float, float]:
    """Return what a controller has asked for at `tick` as two finite numbers.

    Raises
    ------
    ControllerError
        If it is anything else: a controller fault.
    """
    try:
        speed, yaw = cast("tuple[float, float]", command)  # what is no pair is refused just below
        speed, yaw = float(speed), float(yaw)
    except (TypeError, ValueError) as error:
        detail = f"a command is two numbers (speed, yaw rate): got {command!r:.80}"
        raise ControllerError(End.CONTROLLER_FAULT.value, detail) from error
    if not (math.isfinite(speed) and math.isfinite(yaw)):
        detail = f"a command is two finite numbers: got ({speed}, {yaw}) at tick {tick}"
        raise ControllerError(End.CONTROLLER_FAULT.value, detail)
    return speed, yaw


def agent_fault(instance: Instance, commands: Floats) -> str:
    """Return what is said when an e-agent's command, a row of `commands` (N, 2), is not finite."""
    n = int(np.argwhere(~np.isfinite(commands).all(axis=1))[0, 0])
    return f"{instance.names[n]} asked for a command that is not finite"


def collision_detail(instance: Instance, contact: Contact) -> str:
    """Return what is said when a contact of the ego ends the trial."""
    other = contact.other if contact.car == EGO else contact.car
    name = instance.names[other] if other >= 0 else f"obstacle {-1 - other}"
    return f"with {name} at {contact.time:.3f} s"
