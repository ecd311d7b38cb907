"""The trial of each episode: a function of a seed, the environment's number and the episode's number.

Episode k of environment i under the base seed s is trial ``4096 k + i`` of seed s. Environments beyond the first 4,096
are the first of further seeds, ``s + 0x9E3779B97F4A7C15 j mod 2**64``, j = 1, 2, ... With a pool of levels the road
network of an episode is that of a level, drawn from the same numbers; all else is drawn as ever.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final, cast

import numpy as np

from dubins_traffic.errors import InputError
from dubins_traffic.problem import limits
from dubins_traffic.problem.configuration import Configuration
from dubins_traffic.problem.draw import check_numbers, draw, draw_many

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

MOST_ENVS: Final = 4096
"""Most environments that have trials of their own under one seed."""
APART: Final = 0x9E3779B97F4A7C15
"""How far the seeds of blocks of `MOST_ENVS` environments are apart, modulo 2**64: an odd number, as in SplitMix64."""
TEST: Final = 1 << 31
"""Levels to train on are drawn as trials from 0 on, those to test on as trials from here on."""
LEVEL_DRAW: Final = 260
"""The number by which a level is drawn for a trial."""


@dataclass(frozen=True, slots=True)
class Levels:
    """A pool of road networks that are drawn once."""

    count: int
    """How many there are."""
    seed: int = 0
    """What they are drawn from."""
    split: str = "train"
    """``train``, or ``test`` for as many others, none of which is drawn for training."""

    def __post_init__(self) -> None:
        if isinstance(self.count, bool) or not 1 <= self.count < TEST:
            raise InputError("not a number of levels", field="levels.count", value=self.count, expected=">= 1")
        check_numbers(self.seed, 0)
        if self.split not in ("train", "test"):
            raise InputError("no such set of levels", field="levels.split", value=self.split, expected="train or test")

    @staticmethod
    def of(given: Levels | Mapping[str, Any] | int | None) -> Levels | None:
        """Return the pool given by its size, or by a mapping of its parameters."""
        if given is None or isinstance(given, Levels):
            return given
        if isinstance(given, int):
            return Levels(given)
        unknown = given.keys() - {"count", "seed", "split"}
        if unknown or "count" not in given:
            raise InputError("not a pool of levels", field="levels", value=dict(given), expected="count, seed, split")
        return Levels(**given)


class Episodes:
    """Draws the trials of episodes.

    Parameters
    ----------
    levels : Levels, optional
        The pool of road networks; by default each trial has the network that its configuration says.
    """

    def __init__(self, configuration: Configuration, levels: Levels | None = None) -> None:
        self.configuration = configuration
        self._levels = levels
        self._drawn: dict[int, Configuration] = {}

    def draw(self, wanted: Iterable[tuple[int, int, int]]) -> list[Instance]:
        """Return the trials of some episodes, each given by base seed, environment and number."""
        numbered = [(seed, trial_of(env, episode)) for seed, env, episode in wanted]
        groups: dict[tuple[int, int], list[int]] = {}
        for place, (seed, trial) in enumerate(numbered):
            groups.setdefault((seed, self._level_of(seed, trial)), []).append(place)
        by_place: dict[int, Instance] = {}
        for (seed, level), places in groups.items():
            configuration = self.configuration if level < 0 else self._level(level)
            drawn = draw_many(configuration, seed, [numbered[place][1] for place in places])
            by_place.update(zip(places, drawn, strict=True))
        return [by_place[place] for place in range(len(numbered))]

    def _level_of(self, seed: int, trial: int) -> int:
        """Return the number of a trial's level, -1 without a pool."""
        if self._levels is None:
            return -1
        from dubins_traffic.kernels.random import below

        chosen = below(np.uint64(seed), trial, 0, 0, LEVEL_DRAW, self._levels.count)
        return int(chosen) + (TEST if self._levels.split == "test" else 0)

    def _level(self, level: int) -> Configuration:
        """Return the configuration with the network of a level, which is drawn once."""
        if level in self._drawn:
            return self._drawn[level]
        seed = 0 if self._levels is None else self._levels.seed
        network = draw(self.configuration, seed, level).problem.network
        settings = self.configuration.settings.model_copy(update={"network": None})
        self._drawn[level] = replace(self.configuration, settings=settings, network=network)
        return self._drawn[level]


def trial_of(env: int, episode: int) -> int:
    """Return the number of the trial that an episode of an environment is."""
    trial = MOST_ENVS * episode + env
    if not (0 <= env < MOST_ENVS and 0 <= trial < limits.TRIALS):
        raise InputError(
            "no such episode",
            field="episode",
            value=(env, episode),
            expected=f"an environment below {MOST_ENVS}, and an episode below {limits.TRIALS // MOST_ENVS}",
        )
    return trial


def seeds_of(seed: int | Sequence[int | None], envs: int) -> list[tuple[int, int]]:
    """Return the base seed and number of each environment: i under one seed for all, 0 under seeds of their own."""
    if isinstance(seed, int | np.integer):
        places = (divmod(env, MOST_ENVS) for env in range(envs))
        return [((int(seed) + APART * block) % limits.SEEDS if block else int(seed), env) for block, env in places]
    if len(seed) != envs:
        raise InputError("not one seed for each environment", field="seed", value=len(seed), expected=str(envs))
    return [(int(cast(int, each)), 0) for each in seed]
