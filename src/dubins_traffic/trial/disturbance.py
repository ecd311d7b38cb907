"""Disturbances of the ego's commands: delay and loss, seeded."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from dubins_traffic.cars.state import EGO
from dubins_traffic.kernels.random import DRAW, uniform
from dubins_traffic.trial.endings import checked_command

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance


class CommandLine:
    """Delays and loses the ego's commands on their way from the controller to the car.

    First a command may be lost, then what arrives is delayed. In place of a lost command the one that arrived
    before it arrives again; before any has arrived the car stands.
    """

    def __init__(self, instance: Instance) -> None:
        disturbances = instance.added
        self._loss = disturbances.command_loss
        self._instance = instance
        self._under_way = deque([(0.0, 0.0)] * disturbances.command_delay)
        self._latest = (0.0, 0.0)
        self.clear = self._loss == 0.0 and not self._under_way
        """Whether every command takes effect as it is."""

    def take(self, tick: int, command: object) -> tuple[float, float]:
        """Return the command in force in this tick, (m/s, rad/s), given the controller's latest `command`.

        Raises
        ------
        ControllerError
            If `command` is not two finite numbers: a controller fault.
        """
        asked = checked_command(command, tick)
        return asked if self.clear else self._carry(tick, asked)

    def _carry(self, tick: int, command: tuple[float, float]) -> tuple[float, float]:
        if self._loss == 0.0 or self._draw(tick) >= self._loss:
            self._latest = command
        self._under_way.append(self._latest)
        return self._under_way.popleft()

    def _draw(self, tick: int) -> float:
        seed = np.uint64(self._instance.seed)
        return uniform(seed, self._instance.trial, EGO, tick, DRAW.LOSS)
