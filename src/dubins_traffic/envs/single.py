"""A single environment with Gymnasium's interface."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np

from dubins_traffic.envs.channel import TrialView
from dubins_traffic.envs.fleet import Fleet
from dubins_traffic.envs.pictures import MODES, SIDE, Renderer
from dubins_traffic.envs.settings import Settings
from dubins_traffic.envs.spaces import info_of_one, observed, space_of
from dubins_traffic.errors import DubinsTrafficError
from dubins_traffic.learning.flat import SHOWN
from dubins_traffic.policies.rules.fitness import check_fit
from dubins_traffic.shield.tables import Overtakes, check_overtakes

if TYPE_CHECKING:
    import os

    from dubins_traffic.envs.episodes import Levels
    from dubins_traffic.kernels.arrays import Floats
    from dubins_traffic.problem.configuration import Configuration


class TrafficEnv(gymnasium.Env[Any, Any]):
    """The environment of one ego among other cars, judged by the rules of the road.

    Every episode is a trial of the benchmark. ``info["trial"]`` is its instance, with which, and with the commands of
    the actions (`commands`), `run_trial` makes the same record. docs/learning.md has all of it.

    Parameters
    ----------
    config : Configuration, path, name or mapping
        What the trials are drawn from.
    observation, action, frame_skip, reward, cars, levels, formulas
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

    metadata: dict[str, Any] = {"render_modes": list(MODES), "render_fps": 30}  # noqa: RUF012  # Gymnasium's

    def __init__(
        self,
        config: Configuration | str | os.PathLike[str] | Mapping[str, Any],
        *,
        observation: str = "flat",
        action: str = "continuous",
        frame_skip: int = 1,
        reward: Mapping[str, float] | str | None = None,
        cars: int = SHOWN,
        levels: Levels | Mapping[str, Any] | int | None = None,
        formulas: Mapping[str, str] | None = None,
        render_mode: str | None = None,
        width: int = SIDE,
        height: int = SIDE,
    ) -> None:
        self.settings = Settings(config, observation, action, frame_skip, reward, cars, levels, formulas)
        self.observation_space = space_of(observation, self.settings.layout)
        self.action_space = self.settings.actions.space
        self.render_mode = render_mode
        self._renderer = Renderer(render_mode, width, height)
        self.fleet = Fleet(self.settings, 1)
        self._seeded = False
        self._is_shielded = False
        self._interventions: int | None = None
        self._view: TrialView | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin the next episode; with a seed its first one, or that which ``options["episode"]`` names.

        Without a seed ever given one is drawn.
        """
        super().reset(seed=seed)
        if seed is not None or not self._seeded:
            base_seed = int(self.np_random.integers(2**63)) if seed is None else seed
            self.fleet.seed(0, (base_seed, 0), (options or {}).get("episode", 0))
            self._seeded = True
        self.fleet.begin([0])
        self._interventions = 0 if self._is_shielded else None
        instance = self.fleet.instance(0)
        if self.settings.observation == "object":
            bank, row = self.fleet.seat(0)
            self._view = TrialView(bank.group, row)
        return self._observed(), {"trial": instance, **self._states()}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Hold an action for `frame_skip` ticks; see `gymnasium.Env.step`."""
        if self.fleet.ended[0]:
            raise DubinsTrafficError("the episode is over, or has not begun: reset the environment")
        self.fleet.step([action])
        board = self.fleet.board.arrays
        info = info_of_one(board["terms"][0], board["weighted"][0]) | self._states() | self._stepped_in()
        ended, terminated = bool(self.fleet.ended[0]), False
        if ended:
            terminated = self.fleet.is_terminal(0)
            (info["outcome"],) = self.fleet.outcomes([0])
            info["trial"] = self.fleet.instance(0)
        return self._observed(), float(board["reward"][0]), terminated, ended and not terminated, info

    def commands(self, actions: Any) -> Floats:
        """Return the commands, (K, 2), speed in m/s and yaw rate in rad/s, of each tick of steps with these actions."""
        return np.repeat(self.settings.actions.commands(actions), self.settings.frame_skip, axis=0)

    def shield(self, overtakes: Overtakes = "sure") -> None:
        """Keep the ego within rules 1 to 3 from the next episode on (`envs.shielded_ego` is the wrapper).

        Parameters
        ----------
        overtakes : {"sure", "law", "never"}
            When it may cross the centre line, see docs/shield.md.

        Raises
        ------
        InputError
            If `overtakes` is something else, or the car can't keep the rules.
        """
        check_fit(self.settings.sample.problem, owes=False)
        self.fleet.keep(check_overtakes(overtakes))
        self._is_shielded = True

    @property
    def given(self) -> Floats:
        """The commands that the shield has let through in each tick of this episode so far, (K, 2), m/s and rad/s.

        Raises
        ------
        DubinsTrafficError
            If the episode is not under a shield.
        """
        if self._interventions is None:
            raise DubinsTrafficError("the episode is not under a shield: see `commands`")
        return np.array(self.fleet.between(0).given).reshape(-1, 2)

    def render(self) -> Any:
        """Return the present frame as (H, W, 3) uint8, or show it, as `render_mode` says."""
        return self._renderer.render_all(self.fleet)[0]

    def close(self) -> None:
        """Close the page that shows the environment, if there is one."""
        self._renderer.close()

    def _stepped_in(self) -> dict[str, int]:
        """Return the number of ticks of this step in which the shield, if there is one, has changed the command."""
        if self._interventions is None:
            return {}
        before, self._interventions = self._interventions, self.fleet.between(0).interventions
        return {"interventions": self._interventions - before}

    def _states(self) -> dict[str, Any]:
        return {"formulas": self.fleet.states(0)} if self.settings.formulas else {}

    def _observed(self) -> Any:
        if self._view is None:
            return observed(self.settings.observation, self.settings.layout, self.fleet.board.arrays["flat"][0])
        observation = self._view.observe()  # its scan is the one that the laser has made in between
        bank, row = self.fleet.seat(0)
        return observation if observation.scan is None else observation._replace(scan=bank.outlook.ranges[row].copy())
