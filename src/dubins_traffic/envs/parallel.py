"""The environment for PettingZoo: every car an agent, or adversaries around an ego with a controller."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from pettingzoo import ParallelEnv  # pyright: ignore[reportMissingTypeStubs]

from dubins_traffic.cars.state import EGO
from dubins_traffic.envs.about_ego import NAMES
from dubins_traffic.envs.crew import MultiAgentTrials, Roles
from dubins_traffic.envs.pictures import SIDE, Renderer
from dubins_traffic.envs.settings import Settings
from dubins_traffic.envs.terms import Pay
from dubins_traffic.errors import DubinsTrafficError, InputError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.learning.flat import SHOWN
from dubins_traffic.problem.kinds import KEEP_RULES
from dubins_traffic.protocols import End
from dubins_traffic.shield.tables import Overtakes, check_overtakes

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
        or seconds: only what it breaks so soon after the other (`envs.crew.Blame`).
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
        if self.settings.disturbed and ego is None:
            value = self.settings.sample.disturbances
            raise InputError(
                "no agent", field="disturbances", value=value, expected="none, or an ego's controller"
            )
        self.render_mode = render_mode
        self._pay = Pay(roles, reward)
        self._renderer = Renderer(render_mode, width, height)
        self._cars = self.settings.sample.names
        self._ids = [agent_name(car) for car in range(len(self._cars))]
        self.names = dict(zip(self._ids, self._cars, strict=True))
        self._roles = Roles(
            _numbers(self.settings.sample, learned, with_ego=ego is None), ego, excuses=excuses
        )
        self.possible_agents = [self._ids[car] for car in self._roles.learned]
        self.agents: list[str] = []
        size = self.settings.layout.size + len(NAMES)
        self.observation_spaces = {
            name: spaces.Box(-1.0, 1.0, (size,), np.float32) for name in self.possible_agents
        }
        actions = self.settings.actions.space  # of which each agent has its own, seeded by itself
        self.action_spaces = {name: deepcopy(actions) for name in self.possible_agents}
        self._crew: MultiAgentTrials | None = None
        self._seed: int | None = None
        self._episode = 0

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
            if agent not in self.possible_agents:
                raise _no_agent("shield", agent, self.possible_agents)
            self._roles.shields[self._ids.index(agent)] = check_overtakes(overtakes)

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Begin the next episode; with a seed the first one, or that which ``options["episode"]`` names, of that seed.

        Episode k of seed s is trial 4096 k of seed s, as in `envs.single`. Without a seed ever given one is drawn.
        """
        if seed is not None or self._seed is None:
            self._seed = int(seeding.np_random(None)[0].integers(2**63)) if seed is None else seed
            self._episode = int((options or {}).get("episode", 0))
        (instance,) = self.settings.episodes.draw([(self._seed, 0, self._episode)])
        if instance.names != self._cars:
            raise InputError(
                "trials have other cars",
                field="e-agents",
                value=instance.names,
                expected=", ".join(self._cars),
            )
        self._episode += 1
        self._crew = MultiAgentTrials([instance], self._roles, self.settings)
        self._pay.begin()
        self.agents = list(self.possible_agents)
        return self._observed(), {name: {"trial": instance} for name in self.agents}

    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[dict[str, Any], dict[str, float], Flags, Flags, dict[str, dict[str, Any]]]:
        """Hold each agent's action for `frame_skip` ticks; agents without one stand."""
        crew = self._running()
        asked = np.zeros((1, crew.group.state.x.shape[1], 2))
        for name, action in actions.items():
            if name not in self.agents:
                raise _no_agent("action", name, self.agents)
            asked[0, self._ids.index(name)] = self.settings.actions.commands([action])[0]
        crew.step(asked, self.settings.frame_skip)
        ending = crew.group.endings[0]
        over, terminated = ending is not None, ending is not None and ending.end is not End.DURATION
        observations = self._observed()
        rewards: dict[str, float] = {}
        infos: dict[str, dict[str, Any]] = {}
        for name in self.agents:
            rewards[name], infos[name] = self._paid(crew, name)
        if over:
            self.agents = []
        return (
            observations,
            rewards,
            dict.fromkeys(rewards, terminated),
            dict.fromkeys(rewards, over and not terminated),
            infos,
        )

    def render(self) -> Image | None:
        """Return the present frame as (H, W, 3) uint8, or show it, as `render_mode` says."""
        crew = self._begun()
        return self._renderer.render(crew.group, 0, crew.outlook, 0)

    def close(self) -> None:
        """Close the page that shows the environment, if there is one."""
        self._renderer.close()

    @property
    def trial(self) -> Instance:
        """The instance of this episode, in which learners drive the cars that they do."""
        return self._begun().group.instances[0]

    @property
    def commands(self) -> Floats:
        """The commands of all cars in each tick of this episode so far, (K, N, 2), m/s and rad/s."""
        given = self._begun().given
        cars = len(self._cars)  # the tables of a batch may have more places than the trial has cars
        return np.array([of_cars[0, :cars] for of_cars in given]).reshape(len(given), cars, 2)

    def _paid(self, crew: MultiAgentTrials, name: str) -> tuple[float, dict[str, Any]]:
        car = self._ids.index(name)
        reward, info = self._pay.of(crew.terms[0], crew.broken[0], car)
        first = crew.blame[0].first
        info["broke_first"] = None if first is None else self._ids[first]
        if car in self._roles.shields:
            info["interventions"] = int(crew.stepped_in[0, car])
        if crew.group.endings[0] is not None:
            info["trial"] = crew.group.instances[0]
        return reward, info

    def _observed(self) -> dict[str, Any]:
        whole = self._begun().observed[0]
        return {name: whole[self._ids.index(name)] for name in self.agents}

    def _begun(self) -> MultiAgentTrials:
        if self._crew is None:
            raise DubinsTrafficError("an environment has to be reset before it is used")
        return self._crew

    def _running(self) -> MultiAgentTrials:
        crew = self._begun()
        if not self.agents:
            raise DubinsTrafficError("the episode is over: reset the environment")
        return crew


def parallel_env(config: Any, **given: Any) -> TrafficParallelEnv:
    """Return a `TrafficParallelEnv`, under PettingZoo's name for it."""
    return TrafficParallelEnv(config, **given)


def agent_name(car: int) -> str:
    """Return the name of the agent that drives a car, by the car's number."""
    return f"car_{car}" if car > EGO else f"ego_{EGO}"


def _numbers(sample: Instance, learned: Sequence[str] | None, *, with_ego: bool) -> list[int]:
    """Return the numbers of the cars that learners drive."""
    names = sample.names
    for name in learned or ():
        if name not in names[1:]:
            raise _no_agent("learned", name, names[1:])
    cars = [EGO] if with_ego else []
    for car, agent in enumerate(sample.e_agents, start=1):
        if learned is None or agent.name in learned:
            cars.append(car)
        elif agent.kind not in KEEP_RULES:
            raise InputError(
                "an e-agent beside learners",
                field="e-agents",
                value=agent.kind,
                expected=", ".join(sorted(KEEP_RULES)),
            )
    if not cars:
        raise InputError("nobody learns", field="learned", value=learned, expected="at least one car")
    return cars


def _no_agent(field: str, name: str, known: Sequence[str]) -> InputError:
    return InputError("no such agent", field=field, value=name, expected=", ".join(known) or "none")
