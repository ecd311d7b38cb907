"""How fast the monitors of a trial's whole task are: tables looked up per second, of one trial and of a batch.

An update takes one frame of one trial into account in one monitor; the task of the shipped `town` has some 180.
"""

from __future__ import annotations

from time import perf_counter

import numpy as np

from benchmarks.table import Row
from dubins_traffic.logic.formula import propositions
from dubins_traffic.logic.monitor import Monitors
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.specifications.task import task

FRAMES, TURNS = 300, 5
BAR = 1e7


def measure() -> list[Row]:
    """Return the rows of this benchmark: the best of some turns over frames of random propositions."""
    monitors, width = monitors_of_a_task()
    rows: list[Row] = []
    for trials in (1, 64):
        rate = updates_per_second(monitors, width, trials)
        name = f"{monitors.tables} monitors of the whole task of `town`, {trials} trial{'s' * (trials > 1)}"
        rows.append(Row(name, f"{rate:.3g} updates/s", f">= {BAR:g}", rate >= BAR))
    return rows


def monitors_of_a_task() -> tuple[Monitors, int]:
    """Return the monitors of one trial's task, one formula a part, and how many propositions they take."""
    instance = draw(load_config("town"), 0, 0)
    spec = task(instance.problem, instance.names)
    formulas = {str(number): part for number, part in enumerate((*spec.assumptions, *spec.guarantees))}
    names = sorted({name for formula in formulas.values() for name in propositions(formula)})
    return Monitors(formulas, names, instance.problem.period, split=True), len(names)


def updates_per_second(monitors: Monitors, width: int, trials: int) -> float:
    """Return how many monitors take a frame into account per second."""
    values = np.random.default_rng(1).integers(0, 2, size=(8, trials, width))
    monitors.reset(trials)
    monitors.update(values[0])
    best = np.inf
    for _ in range(TURNS):
        began = perf_counter()
        for tick in range(FRAMES):
            monitors.update(values[tick % len(values)])
        best = min(best, perf_counter() - began)
    return FRAMES * trials * monitors.tables / best
