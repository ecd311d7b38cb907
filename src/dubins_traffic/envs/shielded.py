"""The shield as a wrapper of environments for PettingZoo."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, cast

from pettingzoo import ParallelEnv  # pyright: ignore[reportMissingTypeStubs]
from pettingzoo.utils import BaseParallelWrapper  # pyright: ignore[reportMissingTypeStubs]

from dubins_traffic.cars.state import EGO
from dubins_traffic.envs.crew import agent_name
from dubins_traffic.envs.parallel import TrafficParallelEnv
from dubins_traffic.errors import InputError
from dubins_traffic.shield.tables import Overtakes


class Shielded(BaseParallelWrapper[str, Any, Any]):
    """An environment with shields for some agents: the ego then keeps rules 1 to 3, e-agents keep E1 and E2.

    In every tick a command that would break a rule is changed to the nearest one that breaks none; ``interventions``
    in an agent's info is the number of ticks of the step in which that was done.

    Parameters
    ----------
    env : ParallelEnv
        A `TrafficParallelEnv`, or a wrapper of one.
    agents : iterable of str, optional
        Who is kept; by default all agents. `envs.shielded.others` names all but the ego.
    overtakes : {"sure", "law", "never"}
        When they may cross the centre line, see docs/shield.md.

    Raises
    ------
    InputError
        If it is another environment, there is no such agent, or `overtakes` is something else.
    """

    def __init__(
        self,
        env: ParallelEnv[str, Any, Any],
        agents: Iterable[str] | None = None,
        *,
        overtakes: Overtakes = "sure",
    ) -> None:
        super().__init__(env)
        base = cast(object, env.unwrapped)
        if not isinstance(base, TrafficParallelEnv):
            raise InputError("no shield", field="env", value=type(base).__name__, expected="a TrafficParallelEnv")
        base.shield(base.possible_agents if agents is None else agents, overtakes)


def others(env: ParallelEnv[str, Any, Any]) -> list[str]:
    """Return the agents of an environment that are e-agents."""
    return [agent for agent in env.possible_agents if agent != agent_name(EGO)]
