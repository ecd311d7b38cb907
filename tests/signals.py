"""The propositions of `spec.task` on recorded frames, and when the formulas over them are first broken."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from dubins_traffic.cars.state import Frames
from dubins_traffic.problem.instance import Instance
from dubins_traffic.spec import propositions as flags
from dubins_traffic.spec.judge import Breach
from dubins_traffic.spec.logic.formula import Formula, propositions
from dubins_traffic.spec.logic.monitor import Monitors

Signal = npt.NDArray[np.bool_]
Key = tuple[str, int, int]
"""A rule, a car and an intersection (-1: none)."""

_OF_CAR = {"on_road": flags.ON_ROAD, "left": flags.LEFT, "overtaking": flags.OVERTAKING}
_OF_QUEUE = {"stopped": flags.STOPPED, "ahead": flags.AHEAD, "first": flags.FIRST}
_FORMS = {
    r"G !collision_(\w+)": "1.collision",
    r"G \(Y on_road_(\w+) -> on_road_\1\)": "1.road",
    r"G \(left_(\w+) -> overtaking_\1\)": "2.left",
    r"G \(left_(\w+) -> F\[.*\] !left_\1\)": "2.return",
    r"G \(enter_(\w+)_(\d+)_(\d+) -> Y stopped_\1_\2_\3\)": "3.stop",
    r"G \(enter_(\w+)_(\d+)_(\d+) -> Y !ahead_\1_\2_\3\)": "3.order",
    r"G \(enter_(\w+)_(\d+)_(\d+) -> Y clear_\1_\2_\3\)": "3.clear",
    r"G !at_fault_(\w+)": "E2",
    r"G \(first_(\w+)_(\d+)_(\d+) & clear_\1_\2_\3 -> F\[.*\] !\(first_\1_\2_\3 & clear_\1_\2_\3\)\)": "E3.enter",
}
"""The formulas whose propositions are in records, and the rules that they say."""


def stated(instance: Instance, formulas: Sequence[Formula]) -> dict[Key, Formula]:
    """Return the formulas that records decide, by what they say."""
    found: dict[Key, Formula] = {}
    for formula in formulas:
        for form, rule in _FORMS.items():
            match = re.fullmatch(form, str(formula))
            if match:
                name, *point = match.groups()
                vertex = instance.problem.network.vertex((int(point[0]), int(point[1]))) if point else -1
                found[rule, instance.names.index(name), vertex] = formula
    return found


def signals(instance: Instance, frames: Frames) -> dict[str, Signal]:
    """Return those propositions of a whole trial that its labels and contacts tell, (F,) each."""
    found: dict[str, Signal] = {}
    network = instance.problem.network
    heads = np.array([network.lane_ends(lane)[1] for lane in range(network.lanes)] + [-1])[frames.lane]
    for n, name in enumerate(instance.names):
        bits = frames.bits[:, n]
        found |= {f"{word}_{name}": bits & flag != 0 for word, flag in _OF_CAR.items()}
        hits = [contact for contact in frames.contacts if n in (contact.car, contact.other)]
        faults = [hit for hit in hits if hit.at_fault[0 if hit.car == n else 1]]
        for word, contacts in (("collision", hits), ("at_fault", faults)):
            ticks = [contact.tick for contact in contacts]
            found[f"{word}_{name}"] = np.isin(np.arange(len(frames)), ticks)
        for v, (x, y) in enumerate(network.intersections):
            crosses = frames.crosses == v
            others = np.delete(crosses, n, axis=1).any(axis=1)
            found |= {
                f"{word}_{name}_{x}_{y}": (bits & flag != 0) & (heads[:, n] == v)
                for word, flag in _OF_QUEUE.items()
            }
            found[f"enter_{name}_{x}_{y}"] = (bits & flags.ENTERED != 0) & crosses[:, n]
            found[f"clear_{name}_{x}_{y}"] = ~others
    return found


def first_broken(
    formulas: Mapping[Key, Formula], values: Mapping[str, Signal], period: float
) -> dict[Key, int]:
    """Return at which frame the monitor of each formula says false, of those for which it does."""
    names = sorted({name for formula in formulas.values() for name in propositions(formula)})
    monitors = Monitors(
        {str(number): formula for number, formula in enumerate(formulas.values())}, names, period
    )
    monitors.reset(1)
    found: dict[Key, int] = {}
    for tick, row in enumerate(np.stack([values[name] for name in names], axis=1)):
        verdicts = monitors.update(row[None, :])[0]
        for key, verdict in zip(formulas, verdicts.tolist(), strict=True):
            if verdict == 0:
                found.setdefault(key, tick)
    return found


def first_breaches(formulas: Mapping[Key, Formula], breaches: Sequence[Breach]) -> dict[Key, int]:
    """Return at which frame the referee first says that each of the rules is broken."""
    found: dict[Key, int] = {}
    for breach in breaches:
        key = (breach.rule, breach.car, breach.vertex if breach.rule[0] in "3E" else -1)
        if key in formulas:
            found.setdefault(key, breach.tick)
    return found
