"""Many environments at once in which several cars learn: arrays with an axis of environments and one of agents."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from gymnasium.utils import seeding

from dubins_traffic.envs.crew import OF_A_CAR, CrewFleet, Roles, agent_name
from dubins_traffic.envs.episodes import seeds_of
from dubins_traffic.envs.settings import Settings
from dubins_traffic.envs.terms import PAID, Pay, costs_of
from dubins_traffic.errors import DubinsTrafficError, InputError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.learning.flat import SHOWN

if TYPE_CHECKING:
    import os

    from dubins_traffic.envs.episodes import Levels
    from dubins_traffic.problem.configuration import Configuration

Bools = npt.NDArray[np.bool_]


class TrafficParallelVectorEnv:
    """A number of environments, each like `envs.parallel.TrafficParallelEnv`, stepped by compiled code.

    Arrays have an axis of E environments and one of A agents, in the order of `agents`. An environment whose episode is
    over begins the next one in the same step. Episode k of environment i under the seed s is trial ``4096 k + i`` of
    seed s (`envs.episodes`). docs/learning-agents.md has all of it.

    Parameters
    ----------
    num_envs : int
        How many environments, E.
    config, roles, ego, learned, reward, excuses, action, frame_skip, cars, levels
        As of `envs.parallel.TrafficParallelEnv`.
    shields : mapping, optional
        Agents under a shield, by name, each with when it may cross the centre line: ``sure``, ``law`` or ``never``
        (`envs.shielded.Shielded`).

    Attributes
    ----------
    agents : list of str
        The agents' names, A.
    single_action_space, single_observation_space : gymnasium.spaces.Space
        Of one agent.

    Raises
    ------
    InputError
        If anything of this is wrong.
    """

    def __init__(
        self,
        num_envs: int,
        config: Configuration | str | os.PathLike[str] | Mapping[str, Any],
        *,
        roles: str = "adversaries",
        ego: str | None = None,
        learned: Sequence[str] | None = None,
        reward: Mapping[str, Mapping[str, float]] | None = None,
        excuses: bool | str | float = True,
        shields: Mapping[str, str] | None = None,
        action: str = "continuous",
        frame_skip: int = 1,
        cars: int = SHOWN,
        levels: Levels | Mapping[str, Any] | int | None = None,
    ) -> None:
        if isinstance(num_envs, bool) or num_envs < 1:
            raise InputError("can't be a vector environment", field="num_envs", value=num_envs, expected=">= 1")
        self.settings = Settings(config, "flat", action, frame_skip, None, cars, levels)
        self.num_envs = num_envs
        self.fleet = CrewFleet(
            self.settings, num_envs, Roles.of(self.settings, learned, ego, excuses), Pay(roles, reward)
        )
        self.agents = self.fleet.agents
        for name, overtakes in (shields or {}).items():
            self.fleet.shield(name, overtakes, "shields")
        self.single_observation_space = self.fleet.observation_space
        self.single_action_space = self.settings.actions.space
        self.state_size = OF_A_CAR * len(self.settings.sample.names)
        self._seeded = False

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[npt.NDArray[np.float32], dict[str, Any]]:
        """Begin the next episodes of all environments; with a seed the first ones, or ``options["episode"]``, of it.

        Parameters
        ----------
        seed : int or sequence of int, optional
            As of `envs.vector.TrafficVectorEnv`. Without one ever given one is drawn.

        Returns
        -------
        observations : (E, A, F) float32
        info : dict
            ``trial``: the instances, (E,).
        """
        if seed is None and not self._seeded:
            seed = int(seeding.np_random(None)[0].integers(2**63))
        if seed is not None:
            for env, who in enumerate(seeds_of(seed, self.num_envs)):
                self.fleet.seed(env, who, int((options or {}).get("episode", 0)))
            self._seeded = True
        self.fleet.begin(range(self.num_envs))
        return self.fleet.observed, {"trial": self._trials(range(self.num_envs))}

    def step(self, actions: Any) -> tuple[npt.NDArray[np.float32], Floats, Bools, Bools, dict[str, Any]]:
        """Hold the actions of all agents for `frame_skip` ticks.

        Parameters
        ----------
        actions : (E, A, ...)
            Elements of `single_action_space`.

        Returns
        -------
        observations : (E, A, F) float32
            Of the next episode's first frame, where one has ended.
        rewards : (E, A)
        terminated, truncated : (E,) bool
            Whether the trial has ended before its time, or with it.
        info : dict
            ``cost`` (E, A); ``reward_terms``, with weights, and ``costs``, breaches that count, (E, A) by name;
            ``broke_first`` (E,): the car whose breach was the first that counted, -1 so far; ``interventions`` (E, A)
            with shields. Where episodes have ended: ``ended``, their environments (K,); their last ``final_obs``
            (K, A, F) and ``final_state`` (K, S); ``outcome`` and ``trial`` (K,).
        """
        fleet = self.fleet
        if not self._seeded:
            raise DubinsTrafficError("the environments have to be reset before they are stepped")
        fleet.step(actions)
        rewards, info = fleet.of_learners("reward").copy(), self._info()
        terminated, over = np.zeros(self.num_envs, dtype=np.bool_), fleet.ended.copy()
        if fleet.waiting:
            ended: list[int] = np.flatnonzero(over).tolist()
            terminated[ended] = [fleet.is_terminal(env) for env in ended]
            outcomes: Any = np.empty(len(ended), dtype=object)
            outcomes[:] = fleet.outcomes(ended)
            info |= {
                "ended": np.array(ended), "final_obs": fleet.observed[ended], "final_state": fleet.state[ended],
                "outcome": outcomes, "trial": self._trials(ended),
            }  # fmt: skip
            fleet.begin(ended)
        return fleet.observed, rewards, terminated, over & ~terminated, info

    def state(self) -> npt.NDArray[np.float32]:
        """Return the state of all cars of each environment, (E, S) (`envs.crew.CrewFleet.state`)."""
        return self.fleet.state

    def commands(self, actions: Any) -> Floats:
        """Return the commands, (K, 2), speed in m/s and yaw rate in rad/s, that K actions stand for."""
        return self.settings.actions.commands(actions)

    def _info(self) -> dict[str, Any]:
        fleet = self.fleet
        terms, weighted = fleet.of_learners("terms"), fleet.of_learners("weighted")
        cost = costs_of(terms, ego=False)
        if self.agents[0] == agent_name(0):
            cost[:, 0] = costs_of(terms[:, 0], ego=True)
        first = PAID.index("1.collision")
        info = {
            "cost": cost,
            "reward_terms": {name: weighted[..., k].copy() for k, name in enumerate(PAID)},
            "costs": {name: terms[..., k].copy() for k, name in enumerate(PAID) if first <= k < len(PAID) - 2},
            "broke_first": fleet.first.copy(),
        }
        return info | ({"interventions": fleet.stepped_in[:, fleet.learned]} if fleet.roles.shields else {})

    def _trials(self, envs: Iterable[int]) -> Any:
        some = list(envs)
        trials: Any = np.empty(len(some), dtype=object)
        trials[:] = [self.fleet.instance(env) for env in some]
        return trials
