"""Trials of episodes that are stepped together: a group of the engine, and what environments ask of it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from dubins_traffic.engine.group import Group
from dubins_traffic.envs.step_kernel import begin_trials, observe_trials, step_trials
from dubins_traffic.envs.tables import Scale, StepTables, Stride
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.calls import bound
from dubins_traffic.kernels.records import table
from dubins_traffic.observations.outlook import new_outlook

if TYPE_CHECKING:
    from collections.abc import Sequence

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
            group.settle(rows)
            ended, ticks = True, 0
        return ended
