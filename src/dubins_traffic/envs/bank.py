"""Trials of episodes that are stepped together: a group of the engine, and what environments ask of it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from dubins_traffic.engine.group import Group
from dubins_traffic.envs.formulas import FormulaWatch
from dubins_traffic.envs.step_kernel import begin_trials, observe_trials, step_trials
from dubins_traffic.envs.tables import Scale, StepTables, Stride
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.calls import bound
from dubins_traffic.kernels.records import table
from dubins_traffic.observations.outlook import new_outlook

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dubins_traffic.envs.settings import Settings
    from dubins_traffic.problem.instance import Instance


class Board:
    """What a step of all environments gives, in arrays whose rows are environments (`envs.tables.StepTables`).

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
        scale[0].pause = 1 if settings.formulas else 0
        scale[0].middle = float(actions.middle[0])
        scale[0].speed, scale[0].yaw_rate = actions.half.tolist()
        self.arrays: dict[str, Any] = {
            "scale": scale,
            "asked": np.zeros((envs, 2)),
            "terms": np.zeros((envs, len(weights))),
            "weighted": np.zeros((envs, len(weights))),
            "weights": weights,
            "reward": np.zeros(envs),
            "status": np.zeros(envs, dtype=np.int64),
            "flat": np.zeros((envs, settings.layout.size), dtype=np.float32),
            "one": np.zeros(1, dtype=np.int64),
        }


class Bank:
    """Some trials, of which each waits in its first frame until an environment steps it.

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
    """

    def __init__(self, instances: Sequence[Instance], board: Board, shown: int) -> None:
        self.group = Group(instances, keeps_rules=False)
        world = self.group.world
        problems = [instance.problem for instance in instances]
        nets: Ints = np.ascontiguousarray(world.rules["net"])
        around = world.state, world.labels, world.cars, world.obstacles
        self.outlook = new_outlook(problems, nets, world.roads, around, shown)
        self.steps = StepTables(stride=table(Stride, len(instances)), **board.arrays)
        self._step, self._observe = bound(step_trials), bound(observe_trials)
        self.watches: dict[int, FormulaWatch] = {}
        begin_trials(self.outlook, self.steps)

    def observe(self, rows: Ints, envs: Ints) -> None:
        """Write what the egos of some trials observe as that of the environments `envs`."""
        self._observe(rows, envs, self.outlook, self.steps)

    def step(self, rows: Ints, envs: Ints, ticks: int) -> bool:
        """Take some trials up to `ticks` ticks farther, with the actions that stand on the board.

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
            ended, ticks = True, 0
        if self.watches:
            self._settle(rows)
        return ended

    def watch(self, row: int, formulas: Mapping[str, str]) -> None:
        """Judge formulas on the frames of a trial, from its first one on."""
        self.watches[row] = FormulaWatch(self.group, row, formulas)

    def _settle(self, rows: Ints) -> None:
        self.group.settle(rows)
        for row in rows.tolist() if self.watches else ():
            self.watches[row].look()
