"""What the formulas of `specifications.task` say of a recorded trial: when each is broken first, and the verdict."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TypeAlias

from dubins_traffic.cars.state import EGO, NONE, Frames
from dubins_traffic.logic.automaton import VERDICTS
from dubins_traffic.logic.formula import TRUE, Formula, always, conj, eventually, propositions
from dubins_traffic.logic.monitor import Monitors
from dubins_traffic.problem.instance import Instance
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.referee import Breach
from dubins_traffic.rules.valuation import Valuation
from dubins_traffic.scoring.verdict import first_fall
from dubins_traffic.specifications.task import task

Key: TypeAlias = tuple[str, int, int]
"""A rule, a car and an intersection (-1: none)."""

_FORMS = {
    r"G !collision_(\w+)": "1.collision",
    r"G \(Y on_road_(\w+) -> on_road_\1\)": "1.road",
    r"G F visit_(\w+)_(\d+)_(\d+)": "1.goal",
    r"G \(left_(\w+) -> overtaking_\1\)": "2.left",
    r"G \(left_(\w+) -> F\[.*\] \(!left_\1 \| hemmed_\1\)\)": "2.return",
    r"G !turned_(\w+)": "2.turn",
    r"G \(enter_(\w+)_(\d+)_(\d+) -> Y stopped_\1_\2_\3\)": "3.stop",
    r"G \(enter_(\w+)_(\d+)_(\d+) -> Y !ahead_\1_\2_\3\)": "3.order",
    r"G \(enter_(\w+)_(\d+)_(\d+) -> Y clear_\1_\2_\3\)": "3.clear",
    r"G !excess_(\w+)": "E1",
    r"G !at_fault_(\w+)": "E2",
    r"G \(first_(\w+)_(\d+)_(\d+) & clear_\1_\2_\3 -> F\[.*\] !\(first_\1_\2_\3 & clear_\1_\2_\3\)\)": "E3.enter",
    r"G !renewed_(\w+)": "E3.tickets",
    r"G \(exit_(\w+) -> F\[.*\] !exit_\1\)": "E4",
    r"G !stays_(\w+)": "E4",
    r"G !overdue_(\w+)": "E5",
    r"G F free(_)(\d+)_(\d+)": "E6",
}
"""The forms of the task's formulas, and the rules that they say."""
_PLACED = ("1.goal", "3.stop", "3.order", "3.clear", "E3.enter", "E6")


def stated(instance: Instance) -> dict[Key, Formula]:
    """Return the formulas of the task by what they say, E6 with its horizon, which the task leaves out.

    Of E6 that is all only where all time counts, as with a `goal_gap` of 0.
    """
    spec = task(instance.problem, instance.names)
    found: dict[Key, Formula] = {}
    for formula in (*spec.assumptions, *spec.guarantees):
        ((rule, match),) = [
            (rule, match) for form, rule in _FORMS.items() if (match := re.fullmatch(form, str(formula))) is not None
        ]
        name, *point = match.groups()
        vertex = instance.problem.network.vertex((int(point[0]), int(point[1]))) if point else NONE
        car = NONE if rule == "E6" else instance.names.index(name)
        assert rule == "E4" or (rule, car, vertex) not in found
        found[rule, car, vertex] = conj(found.get((rule, car, vertex), TRUE), formula)
        if rule == "E6":
            horizon = RuleParameters.from_mapping(instance.problem.rules).goal_time
            found[rule, car, vertex] = always(eventually(formula.args[0].args[0], (0.0, horizon)))
    return found


def judged(
    instance: Instance, formulas: Mapping[Key, Formula], frames: Frames
) -> tuple[dict[Key, int], dict[Key, str]]:
    """Return at which frame the monitor of each formula first says false, if it does, and its last verdict."""
    names = sorted({name for formula in formulas.values() for name in propositions(formula)})
    texts = {str(number): formula for number, formula in enumerate(formulas.values())}
    monitors = Monitors(texts, names, instance.problem.period)
    monitors.reset(1)
    found: dict[Key, int] = {}
    last: Sequence[int] = ()
    for tick, row in enumerate(Valuation(instance, names).values(frames)):
        last = monitors.update(row[None, :])[0].tolist()
        for key, verdict in zip(formulas, last, strict=True):
            if VERDICTS[verdict] == "false":
                found.setdefault(key, tick)
    return found, {key: VERDICTS[verdict] for key, verdict in zip(formulas, last, strict=True)}


def first_breaches(instance: Instance, formulas: Mapping[Key, Formula], breaches: Sequence[Breach]) -> dict[Key, int]:
    """Return at which frame the referee first says that each of the rules is broken."""
    found: dict[Key, int] = {}
    for breach in breaches:
        car = NONE if breach.rule == "E6" else breach.car
        key = (breach.rule, car, breach.vertex if breach.rule in _PLACED else NONE)
        if key in formulas:
            found.setdefault(key, breach.tick)
    rules, rate = RuleParameters.from_mapping(instance.problem.rules), instance.problem.rate
    for rule, car, _ in formulas:
        if rule == "E1":
            fall = first_fall([one for one in breaches if one.car == car and one.rule[0] in "23"], rules, rate)
            if fall is not None:
                found[rule, car, NONE] = fall[1].tick
    return found


def summed(instance: Instance, verdicts: Mapping[Key, str]) -> dict[str, str]:
    """Return the least verdict of each part of the task, by the names that verdicts on trials have for them."""
    found: dict[str, str] = {}
    for (rule, car, vertex), verdict in verdicts.items():
        part = rule if car == EGO else rule[:2] if rule.startswith("E") else "E1"
        if rule == "1.goal":
            x, y = instance.problem.network.intersections[vertex]
            part = f"1.goal {x} {y}"
        found[part] = min(found.get(part, "true"), verdict, key=VERDICTS.index)
    return {part: _undecided(verdict) for part, verdict in found.items()}


def _undecided(verdict: str) -> str:
    """Return a verdict; of a part that holds for good that it is presumed to: no trial's verdict says more."""
    return "presumably true" if verdict == "true" else verdict
