"""The environment for PettingZoo: every car an agent, or adversaries around an ego with a controller."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.utils import seeding
from pettingzoo import ParallelEnv  # pyright: ignore[reportMissingTypeStubs]

from dubins_traffic.envs.crew import OF_A_CAR, CrewFleet, Roles, agent_name, no_agent
from dubins_traffic.envs.pictures import SIDE, Renderer
from dubins_traffic.envs.settings import Settings
from dubins_traffic.envs.terms import Pay
from dubins_traffic.errors import DubinsTrafficError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.learning.flat import SHOWN
from dubins_traffic.shield.tables import Overtakes

if TYPE_CHECKING:
    import os

    from dubins_traffic.animation.raster_kernel import Image
    from dubins_traffic.envs.episodes import Levels
    from dubins_traffic.problem.configuration import Configuration
    from dubins_traffic.problem.instance import Instance

Flags = dict[str, bool]


class TrafficParallelEnv(ParallelEnv[str, Any, Any]):
    """The cars of a trial as agents: the ego and e-agents, or e-agents around an ego that a controller drives.

    The agents are ``ego_0`` and ``car_1``, ``car_2`` ..., by the numbers of the cars; `names` has those of records.
    Every episode is a trial of the benchmark; `commands` and ``info["trial"]`` give it to `run_trial` again (see
    `envs.citing`). docs/learning-agents.md has all of it.

    Parameters
    ----------
    config : Configuration, path, name or mapping
        What the trials are drawn from; all have the same cars.
    roles : str
        What e-agents are paid for: ``adversaries`` for spoiling the ego's task, ``peers`` for one like the ego's.
    ego : str, optional
        The controller that drives the ego; by default it is an agent.
    learned : sequence of str, optional
        The e-agents that are agents, by their names in records; by default all are. The others do as the configuration
        says, and keep the rules.
    reward : mapping, optional
        Weights of terms that are not as usual: under ``ego`` those of the ego, under ``others`` those of e-agents.
    excuses : bool, str or float
        Whether what one side breaks after the other costs nothing; else each answers for all that it breaks. ``window``
        or seconds: only what it breaks so soon after the other (`envs.blame`).
    action, frame_skip, cars, levels
        As in `envs.settings.Settings`.
    render_mode : str, optional
        ``rgb_array`` or ``human``.
    width, height : int
        Pixels of a picture.

    Raises
    ------
    InputError
        If anything of this is wrong.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  # PettingZoo's
        "name": "dubins_traffic_v0",
        "render_modes": ["rgb_array", "human"],
        "render_fps": 30,
        "is_parallelizable": True,
    }

    def __init__(
        self,
        config: Configuration | str | os.PathLike[str] | Mapping[str, Any],
        *,
        roles: str = "adversaries",
        ego: str | None = None,
        learned: Sequence[str] | None = None,
        reward: Mapping[str, Mapping[str, float]] | None = None,
        excuses: bool | str | float = True,
        action: str = "continuous",
        frame_skip: int = 1,
        cars: int = SHOWN,
        levels: Levels | Mapping[str, Any] | int | None = None,
        render_mode: str | None = None,
        width: int = SIDE,
        height: int = SIDE,
    ) -> None:
        self.settings = Settings(config, "flat", action, frame_skip, None, cars, levels)
        self.render_mode = render_mode
        self._pay = Pay(roles, reward)
        self._renderer = Renderer(render_mode, width, height)
        roles_of = Roles.of(self.settings, learned, ego, excuses)
        roles_of.keeps_commands = True
        self.fleet = CrewFleet(self.settings, 1, roles_of, self._pay)
        self._cars = self.settings.sample.names
        self._ids = [agent_name(car) for car in range(len(self._cars))]
        self.names = dict(zip(self._ids, self._cars, strict=True))
        self.possible_agents = self.fleet.agents
        self.agents: list[str] = []
        # Each agent has spaces of its own, seeded by themselves.
        seen, actions = self.fleet.observation_space, self.settings.actions.space
        self.observation_spaces = {name: deepcopy(seen) for name in self.possible_agents}
        self.action_spaces = {name: deepcopy(actions) for name in self.possible_agents}
        self.state_space = spaces.Box(-np.inf, np.inf, (OF_A_CAR * len(self._cars),), np.float32)
        self._seeded = self._begun = False

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of an agent's observations: `learning.flat`, then `envs.about_ego.NAMES`."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of an agent's actions."""
        return self.action_spaces[agent]

    def shield(self, agents: Iterable[str], overtakes: Overtakes = "sure") -> None:
        """Keep agents within the rules from the next episode on (`envs.shielded.Shielded` is the wrapper).

        Parameters
        ----------
        agents : iterable of str
            Whose commands are changed where they would break a rule: of the ego rules 1 to 3, of an e-agent E1 and E2.
        overtakes : {"sure", "law", "never"}
            When they may cross the centre line.

        Raises
        ------
        InputError
            If there is no such agent.
        """
        for agent in agents:
            self.fleet.shield(agent, overtakes, "shield")

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Begin the next episode; with a seed the first one, or that which ``options["episode"]`` names, of that seed.

        Episode k of seed s is trial 4096 k of seed s, as in `envs.single`. Without a seed ever given one is drawn.
        """
        if seed is not None or not self._seeded:
            base_seed = int(seeding.np_random(None)[0].integers(2**63)) if seed is None else seed
            self.fleet.seed(0, (base_seed, 0), int((options or {}).get("episode", 0)))
            self._seeded = True
        self.fleet.begin([0])
        self._begun = True
        self.agents = list(self.possible_agents)
        return self._observed(), {name: {"trial": self.trial} for name in self.agents}

    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[dict[str, Any], dict[str, float], Flags, Flags, dict[str, dict[str, Any]]]:
        """Hold each agent's action for `frame_skip` ticks; agents without one stand."""
        self._check_begun()
        if not self.agents:
            raise DubinsTrafficError("the episode is over: reset the environment")
        for name in actions:
            if name not in self.agents:
                raise no_agent("action", name, self.agents)
        commands = np.zeros((len(self.agents), 2))
        if actions:
            given = [k for k, name in enumerate(self.agents) if name in actions]
            commands[given] = self.settings.actions.commands([actions[self.agents[k]] for k in given])
        self.fleet.command(commands)
        ended, terminated = bool(self.fleet.ended[0]), self.fleet.is_terminal(0)
        observations, rewards = self._observed(), self.fleet.of_learners("reward")[0].tolist()
        infos = {name: self._info(name, ended=ended) for name in self.agents}
        paid = dict(zip(self.agents, rewards, strict=True))
        if ended:
            self.agents = []
        cut = ended and not terminated
        return observations, paid, dict.fromkeys(paid, terminated), dict.fromkeys(paid, cut), infos

    def state(self) -> npt.NDArray[np.float32]:
        """Return the state of all cars, for critics that see more than one car does (`envs.crew.CrewFleet.state`)."""
        self._check_begun()
        return self.fleet.state[0]

    def render(self) -> Image | None:
        """Return the present frame as (H, W, 3) uint8, or show it, as `render_mode` says."""
        self._check_begun()
        bank, row = self.fleet.seat(0)
        return self._renderer.render(bank.group, row, bank.outlook, row * bank.group.state.x.shape[1])

    def close(self) -> None:
        """Close the page that shows the environment, if there is one."""
        self._renderer.close()

    @property
    def trial(self) -> Instance:
        """The instance of this episode, in which learners drive the cars that they do."""
        self._check_begun()
        return self.fleet.instance(0)

    @property
    def commands(self) -> Floats:
        """The commands of all cars in each tick of this episode so far, (K, N, 2), m/s and rad/s."""
        self._check_begun()
        return self.fleet.bank(0).played(self.fleet.seat(0)[1])

    def _info(self, name: str, *, ended: bool) -> dict[str, Any]:
        fleet, car = self.fleet, self._ids.index(name)
        info = self._pay.tell(car, fleet.board.arrays["terms"][car], fleet.board.arrays["weighted"][car])
        info["broke_first"] = self._ids[fleet.first[0]] if fleet.first[0] >= 0 else None
        if car in fleet.roles.shields:
            info["interventions"] = int(fleet.stepped_in[0, car])
        if ended:
            info["trial"] = self.trial
        return info

    def _observed(self) -> dict[str, Any]:
        return dict(zip(self.possible_agents, self.fleet.observed[0], strict=True))

    def _check_begun(self) -> None:
        if not self._begun:
            raise DubinsTrafficError("an environment has to be reset before it is used")


def parallel_env(config: Any, **given: Any) -> TrafficParallelEnv:
    """Return a `TrafficParallelEnv`, under PettingZoo's name for it."""
    return TrafficParallelEnv(config, **given)
