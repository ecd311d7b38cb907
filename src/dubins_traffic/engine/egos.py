"""Who drives the egos of trials, and how the trials run for it: compiled, asked in every tick, or by themselves.

Batches, campaigns, searches and environments ask here, so that a trial runs in the same way wherever it is run.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from enum import Enum
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dubins_traffic.cars.body import DUBINS
from dubins_traffic.controllers import registry as controllers
from dubins_traffic.controllers.registry import COMPILED
from dubins_traffic.engine.controlled import AskedGroup, BatchController, LanesGroup, Maker, ask_all
from dubins_traffic.engine.group import Group, Outcome
from dubins_traffic.errors import InputError
from dubins_traffic.outside import put_back
from dubins_traffic.policies.rules.fitness import check_fit, check_speeds
from dubins_traffic.problem.kinds import ALONE, FREE, KEEP_RULES
from dubins_traffic.runs.single import Result, run_trial
from dubins_traffic.scoring.metric import Maker as MetricMaker
from dubins_traffic.shield.tables import Overtakes, check_overtakes

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance
    from dubins_traffic.protocols import Controller


class Way(Enum):
    """How a trial runs."""

    COMPILED = "compiled"
    """Together with others; nobody is asked for commands with observations."""
    ASKED = "asked"
    """Together with others; a controller is asked in every tick."""
    ALONE = "alone"
    """By itself."""


class Egos:
    """The controller that drives the egos of some trials, and how these trials run with it.

    Parameters
    ----------
    controller : str or callable
        As `engine.batch.run_batch` takes it.
    uncounted : bool
        Whether `lanes`, too, may drive without observations: then nobody learns how often its shield steps in.
    apart : bool
        Whether each trial has a controller of its own even if one could drive all, so that it can be forked.

    Attributes
    ----------
    name : str
        What outcomes call the controller.
    make : callable
        Makes one; by name from the present folder, wherever those before it have gone.
    is_compiled : bool
        Whether it is `rules`, which the kernel drives.
    """

    def __init__(self, controller: str | Maker, *, uncounted: bool = False, apart: bool = False) -> None:
        self.name = called(controller)
        self.make = _maker(controller)
        spec = controller if isinstance(controller, str) else ""
        self.is_compiled = spec == COMPILED
        bare, overtakes = controllers.shield_of(spec) or (spec, None)
        self._apart = apart
        self._drives_lanes = uncounted and bare == "lanes"
        self._overtakes: Overtakes | None = None
        if self._drives_lanes and overtakes is not None:
            self._overtakes = check_overtakes(overtakes)

    @cached_property
    def shared(self) -> BatchController | None:
        """The controller, if one drives the egos of all trials.

        Raises
        ------
        InputError
            If there is no such controller. That it can't be made is a fault in each trial.
        """
        if self._apart:
            return None
        driver = controllers.made(self.make)
        return driver if isinstance(driver, BatchController) else None

    def ways(self, instances: Iterable[Instance]) -> dict[Way, list[Instance]]:
        """Return the trials that run in each way, in their order."""
        by_way: dict[Way, list[Instance]] = {way: [] for way in Way}
        fits: dict[tuple[Any, ...], bool] = {}
        kept = list(instances)  # what tells trials apart is the identity of their parts, so all have to stay
        for instance in kept:
            by_way[self._way(instance, fits)].append(instance)
        return by_way

    def _way(self, instance: Instance, fits: dict[tuple[Any, ...], bool]) -> Way:
        """Return how a trial runs; `fits` keeps, for trials that are alike, whether their cars can keep the rules."""
        if not can_share(instance):
            return Way.ALONE
        if not self.is_compiled and not self._drives_lanes:
            return Way.ASKED
        problem = instance.problem
        parts = problem.network, problem.rules, problem.car, instance.e_agents
        key = *map(id, parts), problem.intersection_radius
        if key not in fits:
            fits[key] = _is_fit(instance)
        if not fits[key]:
            return Way.ALONE if self.is_compiled else Way.ASKED
        return Way.COMPILED if undisturbed(instance) else Way.ASKED

    def group(
        self,
        instances: Sequence[Instance],
        way: Way,
        metrics: Sequence[MetricMaker] = (),
        numbers: Sequence[int] | None = None,
    ) -> Group:
        """Return trials that are alike (`grouped`) in their first frames, as a group that runs in one way.

        The parameters are those of `AskedGroup`.
        """
        if way is Way.ASKED:
            return AskedGroup(instances, self.make, self.shared, metrics, numbers)
        if self._drives_lanes:
            return LanesGroup(instances, self._overtakes)
        return Group(instances, keeps_rules=True, metrics=metrics)

    def alone(self, instance: Instance, **given: Any) -> Result:
        """Run a trial by itself; `given` are further arguments of `run_trial`."""
        return run_trial(instance, controllers.made(self.make), name=self.name, sketch=False, **given)


def called(controller: str | Maker) -> str:
    """Return the name of a controller that is given by its name or as a callable that makes it."""
    return controller if isinstance(controller, str) else getattr(controller, "__name__", "controller")


def _maker(controller: str | Maker) -> Maker:
    if not isinstance(controller, str):
        return controller
    here = Path.cwd()

    def make() -> Controller:
        with put_back():
            os.chdir(here)
            return controllers.load(controller)

    return make


def ask(
    instances: Iterable[Instance],
    egos: Egos,
    batch: int,
    cancelled: Callable[[], bool] = lambda: False,
    metrics: Sequence[MetricMaker] = (),
) -> Iterator[Outcome]:
    """Run trials, `batch` at a time, and yield the outcome of each when it ends; another trial then takes its place.

    It calls `cancelled` in every tick and raises KeyboardInterrupt if that returns true.

    Parameters
    ----------
    instances
        One for each trial; those that can't be stepped with others run by themselves.
    egos
        Who drives.
    batch
        Most trials that run at a time.
    metrics
        Each makes a further metric for a trial.
    """
    waiting = iter(instances)
    groups: list[Group] = []
    while True:
        if cancelled():
            raise KeyboardInterrupt
        free = batch - sum(len(group.active) for group in groups)
        taken = list(islice(waiting, free)) if 8 * free >= batch else []
        groups += [egos.group(some, Way.ASKED, metrics) for some in grouped(filter(can_share, taken))]
        for own in taken:
            if not can_share(own):
                yield outcome_of(egos.alone(own, metrics=metrics))
        if not groups and not taken:
            return
        if egos.shared is not None:
            ask_all([group for group in groups if isinstance(group, AskedGroup)], egos.shared)
        for own in groups:
            if egos.shared is None:
                own.decide()
        for own in groups:
            own.advance()
            yield from own.fresh(egos.name)
        groups = [group for group in groups if len(group.active)]


def outcome_of(result: Result) -> Outcome:
    """Return the outcome of a trial that has run by itself."""
    return Outcome(result.instance, result.ending, result.score)


def grouped(instances: Iterable[Instance]) -> list[list[Instance]]:
    """Return instances in groups that can be stepped together: of one control rate, width and length of trails."""
    groups: dict[tuple[float, float, float], list[Instance]] = {}
    for instance in instances:
        gap = max((agent.driver.parameters.get("gap") or 0.0 for agent in instance.e_agents), default=0.0)
        groups.setdefault((instance.problem.rate, instance.problem.car.w, gap), []).append(instance)
    return list(groups.values())


def can_share(instance: Instance) -> bool:
    """Tell whether a trial can be batched, whatever drives its ego.

    A free e-agent goes by the clocks of the referee, so there must be one.
    """
    apart = any(agent.kind in ALONE for agent in instance.e_agents)
    unjudged = not instance.problem.rules and any(agent.kind == FREE for agent in instance.e_agents)
    apart = apart or instance.disturbances.reach_e_agents
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
    disturbances = instance.disturbances
    noise = disturbances.position_noise > 0.0 or disturbances.heading_noise > 0.0
    return not noise and disturbances.command_delay == 0 and disturbances.command_loss == 0.0
