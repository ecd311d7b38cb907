"""Drawing instances: ``draw(configuration, seed, trial)`` depends on these three arguments alone."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import islice

from dubins_traffic.errors import InputError
from dubins_traffic.problem import limits
from dubins_traffic.problem.configuration import Configuration
from dubins_traffic.problem.instance import Instance
from dubins_traffic.problem.recipe import Recipe

TOGETHER = 64
"""Number of instances that are drawn at a time."""


def draw(configuration: Configuration, seed: int = 0, trial: int = 0) -> Instance:
    """Return trial number `trial` of a configuration.

    Parameters
    ----------
    configuration : Configuration
        The configuration.
    seed : int
        Root seed, 0 <= seed < 2**64.
    trial : int
        Number of the trial, from 0. It does not depend on any other trial nor on how many there are.

    Raises
    ------
    InputError
        If the seed or number is out of range, the cars don't fit, a goal is off the network, or the rules are asked
        for where they aren't defined.
    """
    check_numbers(seed, trial)
    try:
        return _recipe(configuration).draw(int(seed), int(trial))
    except InputError as error:
        raise error.within(file=configuration.file) from None


def draw_many(configuration: Configuration, seed: int, trials: Iterable[int]) -> Iterator[Instance]:
    """Yield the instances that `draw` returns for the numbers `trials`, much faster.

    It uses compiled code. The parameters and errors are those of `draw`; an error is raised when its trial is reached.
    """
    numbers = iter(trials)
    while some := [int(trial) for trial in islice(numbers, TOGETHER)]:
        for trial in some:
            check_numbers(seed, trial)
        try:
            yield from _recipe(configuration).draw_many(int(seed), some)
        except InputError as error:
            raise error.within(file=configuration.file) from None


def check_numbers(seed: int, trial: int) -> None:
    """Refuse a seed or a number of a trial that is out of range."""
    for name, value, end in (("seed", seed, limits.SEEDS), ("trial", trial, limits.TRIALS)):
        if isinstance(value, bool) or not 0 <= value < end:
            raise InputError(
                f"not a {name}", field=name, value=value, expected=f"an integer >= 0 and < {end}"
            )


def _recipe(configuration: Configuration) -> Recipe:
    recipe = configuration.kept.get(_RECIPE)
    if not isinstance(recipe, Recipe):
        recipe = configuration.kept[_RECIPE] = Recipe(configuration)
    return recipe


_RECIPE = "recipe"
