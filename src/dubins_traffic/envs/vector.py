"""Many environments at once with Gymnasium's interface: a native vector environment on the batch engine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from dubins_traffic.envs.episodes import seeds_of
from dubins_traffic.envs.fleet import Fleet, masked
from dubins_traffic.envs.pictures import MODES, SIDE, Renderer
from dubins_traffic.envs.settings import Settings
from dubins_traffic.envs.spaces import StepInfo, observed, space_of
from dubins_traffic.errors import DubinsTrafficError, InputError
from dubins_traffic.learning.flat import SHOWN

if TYPE_CHECKING:
    import os

    from dubins_traffic.envs.episodes import Levels
    from dubins_traffic.kernels.arrays import Floats
    from dubins_traffic.problem.configuration import Configuration

Bools = npt.NDArray[np.bool_]
VECTORIZED: Final = ("flat", "dict")
TOGETHER: Final = ("close", "reset", "step")
"""What is done to all environments at once."""
GOLDEN: Final = 0.6180339887498949
"""Shares of its multiples are spread evenly, however many there are."""


class TrafficVectorEnv(VectorEnv[Any, Any, Any]):
    """A number of environments, each like `envs.single.TrafficEnv`, stepped by compiled code.

    Episode k of environment i under the seed s is trial ``4096 k + i`` of seed s, whatever `num_envs`; of more than
    4,096 environments the others have further seeds (`envs.episodes`). A copy, by `pickle` too, goes on as this one
    does. Infos are arrays, (E,); those that only some environments have come with a mask, (E,), whose name begins with
    ``_``.

    Parameters
    ----------
    num_envs : int
        How many environments.
    config : Configuration, path, name or mapping
        What the trials are drawn from.
    observation, action, frame_skip, reward, cars, levels, formulas
        As in `envs.settings.Settings`; observations are ``flat`` or ``dict``.
    autoreset_mode : AutoresetMode or str
        When an environment whose episode is over begins the next one: in the next step, which then only does that; in
        the same step, with the last observation and info in ``info["final_obs"]`` and ``info["final_info"]``; or when
        it is reset, by ``options["reset_mask"]``.
    staggered : bool
        Whether the first episodes after a seed are cut, truncated and without an outcome, each at another place, so
        that later ones do not all end and begin in the same step.
    render_mode : str, optional
        ``rgb_array``.
    width, height : int
        Pixels of a picture.

    Raises
    ------
    InputError
        If anything of this is wrong.
    """

    metadata: dict[str, Any] = {"autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012  # Gymnasium's

    def __init__(
        self,
        num_envs: int,
        config: Configuration | str | os.PathLike[str] | Mapping[str, Any],
        *,
        observation: str = "flat",
        action: str = "continuous",
        frame_skip: int = 1,
        reward: Mapping[str, float] | str | None = None,
        cars: int = SHOWN,
        levels: Levels | Mapping[str, Any] | int | None = None,
        formulas: Mapping[str, str] | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        staggered: bool = False,
        render_mode: str | None = None,
        width: int = SIDE,
        height: int = SIDE,
    ) -> None:
        if observation not in VECTORIZED:
            expected = " or ".join(VECTORIZED)
            raise InputError("can't be a vector environment", field="observation", value=observation, expected=expected)
        if isinstance(num_envs, bool) or num_envs < 1:
            raise InputError("can't be a vector environment", field="num_envs", value=num_envs, expected=">= 1")
        self.settings = Settings(config, observation, action, frame_skip, reward, cars, levels, formulas)
        self.num_envs, self.render_mode = num_envs, render_mode
        self._renderer = Renderer(render_mode, width, height)
        self.autoreset_mode = _mode(autoreset_mode)
        self.metadata = {
            "render_modes": list(MODES[:1]),
            "render_fps": 30,
            "autoreset_mode": self.autoreset_mode,
        }
        self.single_observation_space: spaces.Space[Any] = space_of(observation, self.settings.layout)
        self.single_action_space = self.settings.actions.space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.fleet = Fleet(self.settings, num_envs)
        self._seeded = False
        self._nothing = np.zeros(num_envs, dtype=np.bool_)
        self._infos = StepInfo(num_envs)
        self._staggered = self.fleet.is_eager = staggered
        self._left = np.full(num_envs, -1)

    def reset(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin the next episodes of all environments, or of those in ``options["reset_mask"]``.

        Parameters
        ----------
        seed : int or sequence of int, optional
            Begin with the first episodes of a seed; or of environment i with those of environment 0 of a seed of its
            own.
        options : dict, optional
            ``reset_mask``: (E,) bool; ``episode``: the number of the episode to begin with, where there is a seed.
        """
        given = options or {}
        some = masked(self.num_envs, given.get("reset_mask"))
        if isinstance(seed, int):
            super().reset(seed=seed)
        if seed is None and not self._seeded:
            seed = int(self.np_random.integers(2**63))
        if seed is not None:
            who = seeds_of(seed, self.num_envs)
            for env in some if self._seeded else range(self.num_envs):
                self.fleet.seed(env, who[env], given.get("episode", 0))
            self._seeded = True
        self.fleet.begin(some)
        if seed is not None and self._staggered:
            self._left[some] = [self._cut_after(env) for env in some]
            self.fleet.expect(sorted(some, key=lambda env: self._left[env]))
        return self._observed(), self._begun(some) | self._states()

    def render(self) -> tuple[Any, ...] | None:
        """Return the present frames, each (H, W, 3) uint8; None without a render mode."""
        return None if self.render_mode is None else self._renderer.render_all(self.fleet)

    def step(self, actions: Any) -> tuple[Any, Floats, Bools, Bools, dict[str, Any]]:
        """Hold the actions for `frame_skip` ticks; see `gymnasium.vector.VectorEnv.step`."""
        fleet, board = self.fleet, self.fleet.board.arrays
        waiting = fleet.ended.copy() if fleet.waiting else self._nothing
        if waiting is not self._nothing and self.autoreset_mode is not AutoresetMode.NEXT_STEP:
            raise DubinsTrafficError("an episode is over, or has not begun: reset its environment")
        if waiting is not self._nothing and not self._seeded:
            raise DubinsTrafficError("the environments have to be reset before they are stepped")
        fleet.step(actions)
        if self._staggered:
            self._cut()
        if waiting is not self._nothing:
            for name in ("reward", "terms", "weighted"):
                board[name][waiting] = 0.0
        rewards = board["reward"].copy()
        info = self._infos.of_all(board["terms"], board["weighted"]) | self._states()
        if not fleet.waiting:
            return self._observed(), rewards, self._nothing.copy(), self._nothing.copy(), info
        over = fleet.ended & ~waiting
        ended: list[int] = np.flatnonzero(over).tolist()
        terminated = self._nothing.copy()
        terminated[ended] = [fleet.is_terminal(env) for env in ended]
        last = self._ended([env for env in ended if fleet.ending(env) is not None])
        if waiting.any():
            info |= self._restarted(waiting) | self._states()
        if ended and self.autoreset_mode is AutoresetMode.SAME_STEP:
            info |= self._final(over, ended, info, last)
            fleet.begin(ended)
            info |= self._begun(ended) | self._states()
        else:
            info |= last
        return self._observed(), rewards, terminated, over & ~terminated, info

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Return what a method or attribute gives for each environment, (E,).

        These are ``render``, ``trial``, the instance of the present episode, and what the environments have in common.

        Raises
        ------
        AttributeError
            If there is no such thing.
        DubinsTrafficError
            If it acts on all environments at once.
        """
        if name in TOGETHER:
            raise DubinsTrafficError(f"{name}: acts on all environments at once: call it on the vector environment")
        if name == "trial":
            return tuple(self.fleet.instance(env) for env in range(self.num_envs))
        attribute = getattr(self, name)
        value: Any = attribute(*args, **kwargs) if callable(attribute) else attribute
        return value if name == "render" and value is not None else (value,) * self.num_envs

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Return an attribute of each environment, as `call` does."""
        return self.call(name)

    def commands(self, actions: Any) -> Floats:
        """Return the commands, (K, 2), speed in m/s and yaw rate in rad/s, of each tick of one environment's steps."""
        return np.repeat(self.settings.actions.commands(actions), self.settings.frame_skip, axis=0)

    def _cut_after(self, env: int) -> int:
        """Return after how many steps the first episode of an environment is cut: evenly spread shares, 0 the whole."""
        steps = -(-self.fleet.instance(env).ticks // self.settings.frame_skip)
        return int(steps * (1.0 - env * GOLDEN % 1.0))

    def _cut(self) -> None:
        """Cut first episodes whose turn it is."""
        self._left -= self._left > 0
        turn = (self._left == 0) & ~self.fleet.ended
        self._left[self._left == 0] = -1
        if turn.any():
            self.fleet.cut(np.flatnonzero(turn).tolist())

    def _restarted(self, waiting: Bools) -> dict[str, Any]:
        """Begin the next episodes of the environments whose last one was over before this step."""
        some: list[int] = np.flatnonzero(waiting).tolist()
        self.fleet.begin(some)
        return self._begun(some)

    def _begun(self, some: Sequence[int]) -> dict[str, Any]:
        """Return the infos of episodes that begin."""
        return self._spread(some, "trial", [self.fleet.instance(env) for env in some])

    def _states(self) -> dict[str, Any]:
        """Return the verdict on each formula in the environments, (E,) texts by name."""
        if not self.settings.formulas:
            return {}
        each = [self.fleet.states(env) for env in range(self.num_envs)]
        return {"formulas": {name: np.array([states[name] for states in each]) for name in self.settings.formulas}}

    def _ended(self, some: Sequence[int]) -> dict[str, Any]:
        """Return the infos of episodes that have ended."""
        if not some:
            return {}
        outcomes = self._spread(some, "outcome", self.fleet.outcomes(some))
        return outcomes | self._begun(some)

    def _final(self, over: Bools, ended: Sequence[int], info: dict[str, Any], last: dict[str, Any]) -> dict[str, Any]:
        """Return the last observations and infos of episodes that have ended in this step."""
        flat = self.fleet.board.arrays["flat"]
        kind, layout = self.settings.observation, self.settings.layout
        final = {**info, "_reward_terms": over.copy(), "_cost": over.copy(), "_costs": over.copy(), **last}
        observations = self._spread(ended, "final_obs", [observed(kind, layout, flat[env]) for env in ended])
        return {**observations, "final_info": final, "_final_info": over.copy()}

    def _spread(self, some: Sequence[int], name: str, values: Sequence[Any]) -> dict[str, Any]:
        """Return values of some environments as an array of objects, (E,), with its mask."""
        array, mask = np.full(self.num_envs, None, dtype=object), self._nothing.copy()
        for env, value in zip(some, values, strict=True):
            array[env] = value
        mask[list(some)] = True
        return {name: array, f"_{name}": mask}

    def _observed(self) -> Any:
        return observed(self.settings.observation, self.settings.layout, self.fleet.board.arrays["flat"])


def _mode(given: AutoresetMode | str) -> AutoresetMode:
    try:
        return AutoresetMode(given)
    except ValueError:
        expected = ", ".join(mode.value for mode in AutoresetMode)
        raise InputError("no such mode", field="autoreset_mode", value=given, expected=expected) from None
