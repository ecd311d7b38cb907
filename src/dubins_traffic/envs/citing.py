"""Runs episodes again with `run_trial`: all cars play the commands of the episode, which gives the same frames."""

from __future__ import annotations

from dataclasses import replace
from itertools import groupby

from dubins_traffic.cars.state import EGO
from dubins_traffic.controllers.scripted import Scripted
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import EAgent, Instance
from dubins_traffic.problem.kinds import REMOTE, parameters_of


def cited(trial: Instance, commands: Floats) -> tuple[Instance, Scripted]:
    """Return an instance and a controller with which `run_trial` makes the frames of an episode.

    Parameters
    ----------
    trial : Instance
        That of the episode, ``info["trial"]``. E-agents that learners drove play scripts; the others drive again.
    commands : (K, N, 2)
        Speed, m/s, and yaw rate, rad/s, of all cars in each tick.
    """
    agents = tuple(
        EAgent("scripted", agent.name, "scripted", parameters_of("scripted", _script(commands[:, car], trial)))
        if agent.kind == REMOTE
        else agent
        for car, agent in enumerate(trial.e_agents, start=1)
    )
    return replace(trial, e_agents=agents), Scripted(commands[:, EGO])


def _script(commands: Floats, trial: Instance) -> dict[str, object]:
    """Return the parameters of an e-agent that plays commands (K, 2), equal ones at a time."""
    period = trial.problem.period
    steps: list[list[float]] = []
    rows: list[list[float]] = commands.tolist()
    for command, same in groupby(rows):
        steps.append([len(list(same)) * period, *command])
    return {"commands": steps}
