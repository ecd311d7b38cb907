"""Which trials can be batched, and which have to run by themselves."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from dubins_traffic.cars.body import DUBINS
from dubins_traffic.errors import InputError
from dubins_traffic.policies.rules.fitness import check_fit, check_speeds
from dubins_traffic.problem.kinds import ALONE, FREE, KEEP_RULES

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance


def fitness() -> Callable[[Instance], bool]:
    """Return a function that does as `_is_fit` and remembers its answer for trials that are alike."""
    known: dict[tuple[float, ...], bool] = {}

    def fit(instance: Instance) -> bool:
        problem = instance.problem
        own = problem.network, problem.rules, problem.car, instance.e_agents
        key = *map(id, own), problem.intersection_radius
        if key not in known:
            known[key] = _is_fit(instance)
        return known[key]

    return fit


def can_share(instance: Instance) -> bool:
    """Tell whether a trial can be batched, whatever drives its ego.

    A free e-agent goes by the clocks of the referee, so there must be one.
    """
    apart = any(agent.kind in ALONE for agent in instance.e_agents)
    unjudged = not instance.problem.rules and any(agent.kind == FREE for agent in instance.e_agents)
    plain = instance.simulator == "embedded" and instance.problem.car.model == DUBINS
    return plain and not instance.problem.formulas and not apart and not unjudged


def _is_fit(instance: Instance) -> bool:
    """Tell whether the cars can keep the rules; for those that can't, the trial run by itself raises the error."""
    lawful = any(agent.driver.kind in KEEP_RULES for agent in instance.e_agents)
    try:
        check_fit(instance.problem, owes=False)
        if lawful:
            check_fit(instance.problem, owes=True)
            check_speeds(instance)
    except InputError:
        return False
    return True


def undisturbed(instance: Instance) -> bool:
    """Tell whether the ego's observations have no noise and its commands neither delay nor loss."""
    own = instance.disturbances
    noise = own.position_noise > 0.0 or own.heading_noise > 0.0
    return not noise and own.command_delay == 0 and own.command_loss == 0.0
