"""A bank: a group of trials of the engine that environments step, with observations and rewards."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import numpy as np

from dubins_traffic.cars.state import EGO
from dubins_traffic.engine.group import Group
from dubins_traffic.envs.between import Between
from dubins_traffic.envs.formulas import FormulaWatch
from dubins_traffic.envs.step_kernel import begin_trials, observe_trials, step_trials
from dubins_traffic.envs.tables import Scale, StepTables, Stride
from dubins_traffic.envs.terms import costs_of_rules
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.calls import bound
from dubins_traffic.kernels.records import table
from dubins_traffic.observations.outlook import new_outlook

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dubins_traffic.envs.settings import Settings
    from dubins_traffic.problem.instance import Instance
    from dubins_traffic.shield.tables import Overtakes


class Board:
    """The results of a step of all environments, arrays with a row per environment (`envs.tables.StepTables`).

    Parameters
    ----------
    envs : int
        How many there are.
    settings : Settings
        What they have in common.
    """

    def __init__(self, envs: int, settings: Settings) -> None:
        weights, actions = settings.weights, settings.actions
        scale = table(Scale, 1)
        scale[0].period = 1.0 / settings.sample.problem.rate
        scale[0].pause = 1 if settings.formulas or settings.disturbed else 0
        scale[0].waits = 1 if settings.disturbed else 0
        scale[0].middle = float(actions.middle[0])
        scale[0].speed, scale[0].yaw_rate = actions.half.tolist()
        self.arrays: dict[str, Any] = {
            "scale": scale,
            "asked": np.zeros((envs, 2)),
            "terms": np.zeros((envs, len(weights))),
            "weighted": np.zeros((envs, len(weights))),
            "weights": weights,
            "cost_of": costs_of_rules(),
            "reward": np.zeros(envs),
            "status": np.zeros(envs, dtype=np.int64),
            "flat": np.zeros((envs, settings.layout.size), dtype=np.float32),
            "one": np.zeros(1, dtype=np.int64),
        }


class Bank:
    """A group of trials, each of which waits in its first frame until an environment steps it.

    Parameters
    ----------
    instances : sequence of Instance
        One a trial, of one configuration.
    board : Board
        What their steps are written to.
    shown : int
        Other cars that a flat observation shows, at most.

    Attributes
    ----------
    group : Group
        The trials.
    watches : dict
        Who judges formulas on the trials that are watched, by their rows.
    between : dict
        What stands between environments and their egos, of trials that are disturbed or under a shield, by their rows.
    """

    def __init__(self, instances: Sequence[Instance], board: Board, shown: int) -> None:
        self._shown = shown
        self.group = Group(instances, keeps_rules=False)
        world = self.group.world
        problems = [instance.problem for instance in instances]
        nets: Ints = np.ascontiguousarray(world.rules["net"])
        around = world.state, world.labels, world.cars, world.obstacles
        self.outlook = new_outlook(problems, nets, world.roads, around, shown)
        self.steps = StepTables(stride=table(Stride, len(instances)), **board.arrays)
        self._step, self._observe = bound(step_trials), bound(observe_trials)
        self.watches: dict[int, FormulaWatch] = {}
        self.between: dict[int, Between] = {}
        begin_trials(self.outlook, self.steps)

    def observe(self, rows: Ints, envs: Ints) -> None:
        """Write the observations of the egos of some trials as those of the environments `envs`."""
        self._observe(rows, envs, self.outlook, self.steps)
        self._look(rows, envs)

    def step(self, rows: Ints, envs: Ints, ticks: int) -> bool:
        """Step some trials by up to `ticks` ticks, with the actions on the board.

        Returns
        -------
        bool
            Whether some have ended.

        Raises
        ------
        InputError
            If an action is not finite; then nothing has been stepped.
        """
        group, ended = self.group, False
        while found := self._step(rows, envs, ticks, group.commands, group.world, self.outlook, self.steps):
            if found < 0:
                raise InputError("not an action", field="action", expected="finite numbers")
            self._settle(rows)
            if self.between:
                self._pass_on(rows, envs, begins=ticks > 0)
            ended, ticks = True, 0
        if self.watches or self.between:
            self._settle(rows)
            self._look(rows, envs)
        return ended

    def stand_between(self, row: int, shield: Overtakes | None) -> None:
        """Put what disturbs a trial, and a shield, between its environment and its ego, from its first frame on."""
        self.between[row] = Between(self.group, row, self._shown, shield)

    def watch(self, row: int, formulas: Mapping[str, str]) -> None:
        """Judge formulas on the frames of a trial, from its first one on."""
        self.watches[row] = FormulaWatch(self.group, row, formulas)

    def _look(self, rows: Ints, envs: Ints) -> None:
        """Write the observations of the present frames as disturbances change them."""
        for row, env in zip(rows.tolist(), envs.tolist(), strict=True) if self.between else ():
            if row in self.between:
                self.between[row].look(self.steps.flat[env])

    def _pass_on(self, rows: Ints, envs: Ints, *, begins: bool) -> None:
        """Replace the egos' commands for the coming tick by what disturbances and shields make of them."""
        self._look(rows, envs)
        for row in rows.tolist():
            own, stride = self.between.get(row), cast(Stride, self.steps.stride[row])
            if own is not None and stride.left > 0:
                command = self.group.commands[row, EGO]
                command[:] = own.command(command if begins else None)

    def _settle(self, rows: Ints) -> None:
        self.group.settle(rows)
        for row in rows.tolist() if self.watches else ():
            self.watches[row].look()
