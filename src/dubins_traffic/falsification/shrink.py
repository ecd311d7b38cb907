"""Shrinking: what a failure does not need is taken away, one thing at a time, until nothing more can be."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

from dubins_traffic.agents import choices
from dubins_traffic.cars.state import Pose
from dubins_traffic.engine.controlled import Maker
from dubins_traffic.errors import ControllerError, DubinsTrafficError, InputError
from dubins_traffic.falsification import whims
from dubins_traffic.falsification.case import (
    Case,
    Judged,
    Make,
    Story,
    confirm,
    judge,
    read_case,
    sentence_of,
)
from dubins_traffic.falsification.remote import Remote
from dubins_traffic.falsification.sampling import CHOSEN
from dubins_traffic.falsification.trying import TrialRunner, driver_of, in_order
from dubins_traffic.logic.formula import ticks
from dubins_traffic.problem.document import instance_from_document, instance_to_document
from dubins_traffic.problem.instance import EAgent, Instance
from dubins_traffic.problem.kinds import FREE, KINDS, parameters_of
from dubins_traffic.problem.parts import Disturbances
from dubins_traffic.roads.formats.rnd import extent
from dubins_traffic.roads.network import RoadNetwork

if TYPE_CHECKING:
    from dubins_traffic.cars.state import Frames


LATER: Final = (1.0, 0.75, 0.5, 0.25, 0.125)
"""Shares of a trial's beginning, `LEAD` before its end, that are tried to be left out."""
LEAD: Final = 2.0
"""Seconds that a trial lasts at least before its breach, so that it shows how that came about."""
REDRAWN: Final = 8
"""As so many trials, by their numbers, an instance with a car less is tried beside its own."""
KEPT: Final = frozenset({"choices", "cycle", "commands", "whims", "kind", "parameters"})
"""Parameters of e-agents that have no default to go back to, or a way of their own to be taken away."""

Removal = tuple[str, Instance]
"""What is taken away, in words, and the instance without it."""
Way = Callable[[Instance, "Frames"], Iterator[Removal]]


def removals(instance: Instance, frames: Frames) -> Iterator[Removal]:
    """Yield every instance with one thing less than `instance`, whose trial had these frames; the largest things first.

    Those that are none, since a road network falls apart, are left out.
    """
    for way in WAYS:
        yield from way(instance, frames)


def lead(instance: Instance) -> int:
    """Return how many ticks the trial of an instance lasts at least before its breach."""
    return ticks(LEAD, instance.problem.period)


def without_cars(instance: Instance, frames: Frames) -> Iterator[Removal]:  # noqa: ARG001  # a `Way`
    """Yield the instances without one of the e-agents, the last first.

    What is drawn in a trial follows from the numbers of cars and trial, and others move up: so each is also tried as
    the first few trials.
    """
    for car in range(len(instance.e_agents), 0, -1):
        agents = (*instance.e_agents[: car - 1], *instance.e_agents[car:])
        problem = replace(instance.problem, e_agents=tuple(agent.name for agent in agents))
        starts = (*instance.starts[:car], *instance.starts[car + 1 :])
        for trial in dict.fromkeys((instance.trial, *range(REDRAWN))):
            less = replace(instance, problem=problem, e_agents=agents, starts=starts, trial=trial)
            yield f"the car {instance.names[car]}", less


def begun_later(instance: Instance, frames: Frames) -> Iterator[Removal]:
    """Yield the instances whose cars start where they were after a share of the trial, the largest first."""
    spare = min(len(frames) - 1, instance.ticks) - lead(instance)
    for tick in dict.fromkeys(int(share * spare) for share in LATER):
        if tick > 0:
            duration = (instance.ticks - tick) / instance.problem.rate
            yield f"the first {tick} ticks", replace(instance, starts=_poses(frames, tick), duration=duration)


def without_choices(instance: Instance, frames: Frames) -> Iterator[Removal]:  # noqa: ARG001  # a `Way`
    """Yield the instances in which one more thing is left to the law, or one parameter to its default."""
    for car, agent in enumerate(instance.e_agents, start=1):
        if agent.kind == CHOSEN:
            for table in choices.reductions(choices.table_of(agent)):
                yield f"a choice of {agent.name}", choices.with_choices(instance, {car: table})
        if agent.kind == FREE:
            for table in whims.reductions(whims.table_of(agent)):
                yield f"a whim of {agent.name}", whims.with_whims(instance, {car: table})
        if agent.kind not in KINDS:
            continue
        for name, default in _defaults(agent).items():
            if agent.parameters.get(name) != default:
                usual = replace(agent, parameters={**agent.parameters, name: default})
                yield f"the {name} of {agent.name}", _with_agent(instance, car, usual)


def without_goals(instance: Instance, frames: Frames) -> Iterator[Removal]:  # noqa: ARG001  # a `Way`
    """Yield the instances without one of the goals."""
    goals = instance.problem.goals
    for k, goal in enumerate(goals):
        rest = (*goals[:k], *goals[k + 1 :])
        yield f"the goal {goal}", replace(instance, problem=replace(instance.problem, goals=rest))


def without_things(instance: Instance, frames: Frames) -> Iterator[Removal]:  # noqa: ARG001  # a `Way`
    """Yield the instances without one of the obstacles, or one of the disturbances."""
    obstacles = instance.problem.obstacles
    for k in range(len(obstacles)):
        rest = (*obstacles[:k], *obstacles[k + 1 :])
        yield f"obstacle {k}", replace(instance, problem=replace(instance.problem, obstacles=rest))
    for name, model_field in Disturbances.model_fields.items():
        if getattr(instance.disturbances, name) != model_field.default:
            undisturbed = instance.disturbances.model_copy(update={name: model_field.default})
            yield f"the {name}", replace(instance, disturbances=undisturbed)


def without_roads(instance: Instance, frames: Frames) -> Iterator[Removal]:  # noqa: ARG001  # a `Way`
    """Yield the instances without one of the roads, as far as the rest hangs together."""
    network = instance.problem.network
    for k, road in enumerate(network.segments):
        smaller = _smaller(network, k)
        if smaller is None or not set(instance.problem.goals) <= set(smaller.intersections):
            continue
        yield f"the road {road}", replace(instance, problem=replace(instance.problem, network=smaller))


WAYS: Final[tuple[Way, ...]] = (
    without_cars, begun_later, without_goals, without_things, without_choices, without_roads,
)  # fmt: skip


def _smaller(network: RoadNetwork, k: int) -> RoadNetwork | None:
    rest = (*network.segments[:k], *network.segments[k + 1 :])
    if not rest:
        return None
    corners = (*network.corners[:k], *network.corners[k + 1 :])
    try:
        return RoadNetwork(rest, network.length, network.transform, extent(rest), corners=corners)
    except DubinsTrafficError:
        return None


def _poses(frames: Frames, tick: int) -> tuple[Pose, ...]:
    columns = (frames.x, frames.y, frames.c, frames.s)
    return tuple(Pose(*(float(column[tick, n]) for column in columns)) for n in range(frames.x.shape[1]))


def _with_agent(instance: Instance, car: int, agent: EAgent) -> Instance:
    agents = (*instance.e_agents[: car - 1], agent, *instance.e_agents[car:])
    return replace(instance, e_agents=agents)


def _defaults(agent: EAgent) -> Mapping[str, Any]:
    try:
        known = parameters_of(agent.kind, {})
    except InputError:
        return {}
    return {name: value for name, value in known.items() if name not in KEPT}


Progress = Callable[[str], object]


def shrink(
    case: Case | str | os.PathLike[str],
    controller: str | Maker | Remote | None = None,
    progress: Progress | None = None,
) -> Case:
    """Return the smallest case that is found by taking things away from a case: one thing less, and the breach is gone.

    Cars, the beginning of the trial, goals, obstacles, choices and roads are taken away one at a time, as long as the
    ego still breaks the same rule within the assumption, judged afresh each time; the end is cut to the breach.

    Parameters
    ----------
    case : Case or path
        What is shrunk.
    controller : str, callable or Remote, optional
        Who drives; by default the one of the case.
    progress : callable, optional
        Is told what has been taken away.

    Raises
    ------
    InputError
        If the case does not break its rule with that controller.
    ControllerError
        If that is since the controller ends the trial before.
    """
    begun = case if isinstance(case, Case) else read_case(case)
    driver = begun.story.controller if controller is None else controller
    make = driver_of(driver)
    name = driver if isinstance(driver, str) else begun.story.controller
    shrinker = _Shrinker(driver, make, name, begun.story.rule)
    failing = confirm(begun.instance, begun.story.rule, make, name)
    if failing is None:
        ending = judge(begun.instance, make, name).record.ending
        if ending is not None and ending.by_controller:
            raise ControllerError(ending.end.value, f"the case ended by a fault: {ending}")
        file = None if isinstance(case, Case) else os.fspath(case)
        raise InputError(
            "the ego does not break the rule", file=file, field="case.rule", value=begun.story.rule,
            expected="a case that fails with this controller",
        )  # fmt: skip
    failing = shrinker.shrunk(failing, progress)
    return retold(begun.story, name, failing)


def retold(story: Story, name: str, judged: Judged) -> Case:
    """Return a case like one that is known, with what has now been judged of it."""
    breach = judged.breach(story.rule)
    if breach is None:
        raise DubinsTrafficError("a case without its breach")
    sentence = sentence_of(judged.record, judged.score, breach)
    return Case(
        replace(judged.record.instance, extra={}),
        replace(story, controller=name, time=breach.time, tick=breach.tick, sentence=sentence),
    )


def single_removals(judged: Judged) -> list[Removal]:
    """Return every instance with one thing less than one that has been judged, those that can't be run left out."""
    return [
        (what, instance)
        for what, instance in removals(judged.record.instance, judged.record.frames)
        if _is_sound(instance)
    ]


class _Shrinker:
    """Takes things away while the ego goes on breaking `rule`."""

    def __init__(self, driver: str | Maker | Remote, make: Make, name: str, rule: str) -> None:
        self._runner = TrialRunner(driver)
        self._make, self._name, self._rule = make, name, rule

    def shrunk(self, failing: Judged, progress: Progress | None) -> Judged:
        """Return what is left when nothing more can be taken away."""
        smaller = True
        while smaller:
            smaller = False
            for way in WAYS:
                while (less := self._less(failing, way)) is not None:
                    what, failing = less
                    smaller = True
                    if progress is not None:
                        progress(what)
        return failing

    def _less(self, failing: Judged, way: Way) -> tuple[str, Judged] | None:
        """Return the first instance with one thing less in which the breach stands."""
        record = failing.record
        tried = [(what, smaller) for what, smaller in way(record.instance, record.frames) if _is_sound(smaller)]
        if not tried:
            return None
        findings = in_order(self._runner.attempt([smaller for _, smaller in tried]))
        for (what, smaller), came in zip(tried, findings, strict=True):
            if any(cell.rule == self._rule for cell, _ in came.cells):
                again = confirm(smaller, self._rule, self._make, self._name)
                if again is not None and self._keeps_lead(again, failing):
                    return what, again
        return None

    def _keeps_lead(self, again: Judged, before: Judged) -> bool:
        """Tell whether the breach comes no sooner than it may: what begins with it shows nothing."""
        now, then = again.breach(self._rule), before.breach(self._rule)
        least = lead(again.record.instance)
        return now is not None and then is not None and now.tick >= min(least, then.tick)


def _is_sound(instance: Instance) -> bool:
    """Tell whether an instance is one that its document would give."""
    try:
        instance_from_document(instance_to_document(instance))
    except InputError:
        return False
    return True
