"""Trials that are stepped together, whose egos the controller `lanes` drives, without observations.

What comes of them is what comes of the same trials with the controllers ``lanes`` or ``lanes+shield``, bit for bit, in
a fraction of the time: what the egos see is read where it stands, and one kernel shields them all.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from dubins_traffic.cars.state import EGO
from dubins_traffic.controllers.lanes import Lanes
from dubins_traffic.engine.group import Group
from dubins_traffic.errors import ControllerError
from dubins_traffic.protocols import End
from dubins_traffic.shield.car_shields import EgoShields
from dubins_traffic.shield.tables import Overtakes
from dubins_traffic.trial.endings import checked_command
from dubins_traffic.trial.seat import Answerable

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance


STAND = (0.0, 0.0)
"""The command of an ego whose trial has ended."""


class LanesTogether:
    """The trials of one group, and who drives their egos.

    Parameters
    ----------
    instances : sequence of Instance
        One a trial, as for `Group`, of cars that can keep the rules, undisturbed (`engine.sharing`).
    overtakes : {"sure", "law", "never"} or None
        When the shield lets an ego cross the centre line; None: there is no shield.

    Attributes
    ----------
    group : Group
        The trials.
    """

    def __init__(self, instances: Sequence[Instance], overtakes: Overtakes | None) -> None:
        self.group = Group(instances, keeps_rules=False)
        problems = [instance.problem for instance in instances]
        self._shields = None
        if overtakes is not None:
            self._shields = EgoShields(problems, self.group.state, self.group.labels, overtakes=overtakes)
        self._ticks = np.full(len(instances), -1)
        self._guard = Answerable()
        self._seats = [(Lanes(), problem.sensing_radius) for problem in problems]
        for b, ((lanes, _), problem) in enumerate(zip(self._seats, problems, strict=True)):
            try:
                with self._guard:
                    lanes.start(problem)
            except ControllerError as error:
                self._end(b, error)

    def step(self) -> None:
        """Take all trials that have not ended to their next frame."""
        group = self.group
        now: list[int] = group.ticks.tolist()
        driven: list[int] = group.active.tolist()
        commands = [self._command(b, now[b]) for b in driven]
        if driven:
            group.commands[driven, EGO] = commands
        if self._shields is not None:
            self._ticks[:] = -1
            self._ticks[group.active] = group.ticks[group.active]
            self._shields.filter(self._ticks, group.commands)
        group.advance()

    def _command(self, b: int, tick: int) -> tuple[float, float]:
        """Return the command of the ego of trial b; a fault ends the trial.

        The guard, whose `with` takes as long as some commands, is entered only when something has been raised.
        """
        lanes, radius = self._seats[b]
        try:
            command = lanes.act_in(b, tick, radius, self.group.state)
            return command if self._shields is not None else checked_command(command, tick)
        except ControllerError as error:
            self._end(b, error)
        except Exception:
            self._guard.tick = tick
            try:
                with self._guard:
                    raise
            except ControllerError as error:
                self._end(b, error)
        return STAND

    def _end(self, b: int, error: ControllerError) -> None:
        self.group.end(b, End(error.reason), error.detail)
