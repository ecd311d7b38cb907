"""Replays given commands of the ego, such as those of a record."""

from __future__ import annotations

import numpy as np

from dubins_traffic.cars.state import EGO, Command, Observation
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import Problem
from dubins_traffic.record.reader import Record, read


class Scripted:
    """Plays one command per tick, whatever happens, and gives up after the last.

    Parameters
    ----------
    commands : (K, 2) float64
        Speed in m/s and yaw rate in rad/s of each tick.
    """

    def __init__(self, commands: Floats) -> None:
        self._commands = commands

    @staticmethod
    def of(record: Record) -> Scripted:
        """Return a controller that plays the ego's commands in `record`; on its instance they reproduce its frames."""
        frames = record.frames
        columns = frames.command_speed[1:, EGO], frames.command_yaw_rate[1:, EGO]
        return Scripted(np.stack(columns, axis=1))

    def start(self, problem: Problem) -> None:
        """Do nothing: the commands do not depend on the problem."""

    def act(self, observation: Observation) -> Command | None:
        """Return the command of this tick, None after the last."""
        if observation.tick >= len(self._commands):
            return None
        return Command(*self._commands[observation.tick].tolist())


def replay(path: str) -> Scripted:
    """Return a controller that plays the ego's commands in the record at `path`; RecordError if there is none."""
    return Scripted.of(read(path))
