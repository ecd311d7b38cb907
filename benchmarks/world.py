"""One world of 8 cars, stepped from Python tick by tick, the ego's observations included."""

from __future__ import annotations

from time import process_time

from benchmarks.batch import configuration
from benchmarks.table import Row
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.runs.single import Trial

ROUNDS = 20


def measure() -> list[Row]:
    """Return the rows of this benchmark; the best round counts."""
    instance = draw(load_config(configuration(agents=7)), 1, 0)
    best = float("inf")
    for _ in range(ROUNDS):
        trial = Trial(instance)
        began = process_time()
        while trial.ending is None:
            trial.step((0.3, 0.1))
        best = min(best, process_time() - began)
    rate = len(instance.starts) * instance.ticks / best
    name = "one world, 8 cars, `lawful` e-agents, observed, from Python"
    return [Row(name, f"{rate:.2e} car-steps/s", ">= 5e5", rate >= 5e5)]
