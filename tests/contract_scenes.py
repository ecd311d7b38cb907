"""Scenes in which e-agents try to block the ego `rules`, or an ego tries to bring `lawful` cars to a breach.

A scene is given by its name and a number, which decides network, body, control rate and all distances. `trial` runs one
and says what came of it; the bars are in `tests.conformance.test_contract`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

from dubins_traffic.errors import InputError
from dubins_traffic.problem.instance import Problem
from dubins_traffic.problem.obstructions import check_obstructions
from dubins_traffic.problem.parts import Disturbances
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.judging import Judging
from tests.contract_blocking import BLOCKING
from tests.contract_provoking import PROVOKING, UNCLAIMED
from tests.contract_stages import Scene

SCENES: Final[Mapping[str, Scene]] = {**BLOCKING, **PROVOKING, **UNCLAIMED}


@dataclass(frozen=True, slots=True)
class Came:
    """What came of a scene: the ego's breaches before the first of the others', these, the visits, the longest wait.

    That is the longest time without a visit until the first breach of an e-agent's or the end, seconds. A scene that is
    not `admitted` has obstacles that every document with them is refused for (docs/rules.md#passable).
    """

    name: str
    number: int
    own: tuple[str, ...]
    others: tuple[str, ...]
    visits: int
    waited: float
    bound: float
    admitted: bool


def bound_of(problem: Problem, rules: RuleParameters) -> float:
    """Return how long the ego may be kept waiting by cars that break nothing, seconds: see `test_contract`."""
    longest = float(problem.network.lengths.max()) / problem.car.bounds.speed
    journey = 2.0 * rules.rest_time + rules.journey_lengths * longest
    return (1 + len(problem.e_agents)) * journey + rules.goal_time


def is_admitted(problem: Problem) -> bool:
    """Tell whether no obstacle bars a goal or the way to one."""
    try:
        check_obstructions(problem)
    except InputError:
        return False
    return True


def trial(name: str, number: int, seconds: float | None = None, disturbances: Disturbances | None = None) -> Came:
    """Run scene `name`, variation `number`, for as long as its bars need, or for `seconds`, perhaps disturbed."""
    instance, controller = SCENES[name](number)
    if disturbances is not None:
        instance = replace(instance, disturbances=disturbances)
    if seconds is not None:
        instance = replace(instance, duration=seconds)
    times = Judging()
    result = run_trial(instance, controller, sinks=[times], sketch=False)
    verdict = result.score.verdict
    assert verdict is not None
    others = [one for one in verdict.violations if one.car != "ego"]
    fall = others[0].tick if others else math.inf
    own = tuple(f"{one.rule} {one.time:.2f}" for one in verdict.violations if one.car == "ego" and one.tick < fall)
    end = others[0].time if others else result.ending.ticks / instance.problem.rate
    visits = [tick / instance.problem.rate for tick, _ in times.visits]
    marks = [0.0, *(time for time in visits if time < end), end]
    rules = RuleParameters.from_mapping(instance.problem.rules)
    return Came(
        name, number, own, tuple(f"{one.rule} {one.car} {one.since:.2f}-{one.time:.2f}" for one in others),
        len(visits), max(b - a for a, b in pairwise(marks)), bound_of(instance.problem, rules),
        is_admitted(instance.problem),
    )  # fmt: skip
