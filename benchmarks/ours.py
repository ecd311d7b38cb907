"""How fast this package takes cars through ticks, by processor time on one thread: what peers are compared with."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from time import perf_counter, process_time
from typing import Any

import numpy as np

from benchmarks.batch import circling, configuration
from benchmarks.motion import bare
from benchmarks.rates import BATCH, MOTION, WORLD, Rate
from dubins_traffic.cars.state import Pose
from dubins_traffic.engine.batch import outcomes
from dubins_traffic.errors import DubinsTrafficError
from dubins_traffic.gazebo.simulator import Gazebo
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.runs.single import Trial
from dubins_traffic.simulators.embedded import Embedded

GRIDS = {8: (4, 5), 64: (10, 16)}
"""Rows and columns of the grid for so many cars, about 2.5 intersections a car."""
CAR_STEPS = 500_000
"""Car-steps that a round takes at least, where it can be chosen."""
ROUNDS = 3
MOVED = 300
STEPPED = 60


def rates(cars: int) -> Iterator[Rate]:
    """Yield how fast a bare kernel, motion alone, full trials in a batch, and one world from Python are."""
    instances = trials(cars)
    yield Rate("bare kernel: arcs, all pairs at the end pose", cars, _bare(cars))
    yield Rate(MOTION, cars, _motion(instances))
    yield Rate(BATCH, cars, _batch(instances))
    yield Rate(WORLD, cars, _world(instances[0]))


def trials(cars: int) -> list[Instance]:
    """Return as many trials of a minute as a round of a batch takes: an ego and `lawful` e-agents on a grid."""
    document: dict[str, Any] = configuration(agents=cars - 1)
    rows, columns = GRIDS[cars]
    document["network"]["grid"] |= {"rows": rows, "columns": columns}
    config = load_config(document)
    first = draw(config, 1, 0)
    count = math.ceil(CAR_STEPS / (cars * first.ticks))
    return [first, *(draw(config, 1, trial) for trial in range(1, count))]


def _best(steps: int, work: Callable[[], object]) -> float:
    """Return the steps a second of the best round; the first one warms up."""
    took: list[float] = []
    for _ in range(ROUNDS + 1):
        began = process_time()
        work()
        took.append(process_time() - began)
    return steps / min(took[1:])


def _bare(cars: int) -> float:
    worlds = 32_768 // cars
    rng = np.random.default_rng(1)
    heading = rng.uniform(-math.pi, math.pi, (cars, worlds))
    x, y = rng.uniform(0.0, 16.0, (2, cars, worlds))
    speed, yaw = np.full((cars, worlds), 0.4), rng.uniform(-1.0, 1.0, (cars, worlds))
    hits = np.zeros(worlds, dtype=np.int64)
    state = (x, y, np.cos(heading), np.sin(heading))

    def work() -> None:
        for _ in range(STEPPED):
            bare(*state, speed, yaw, 1.0 / 30.0, 0.354, hits)

    return _best(cars * worlds * STEPPED, work)


def _motion(instances: Sequence[Instance]) -> float:
    simulator = Embedded()
    state = simulator.reset(instances)
    commands = circling(state.x.shape)

    def work() -> None:
        for _ in range(MOVED):
            simulator.step(commands)

    return _best(state.x.size * MOVED, work)


def _batch(instances: Sequence[Instance]) -> float:
    steps = sum(len(instance.starts) * instance.ticks for instance in instances)
    return _best(steps, lambda: list(outcomes(instances)))


def _world(instance: Instance) -> float:
    def work() -> None:
        trial = Trial(instance)
        while trial.ending is None:
            trial.step((0.3, 0.1))

    return _best(len(instance.starts) * instance.ticks, work)


def gazebo(cars: int) -> Rate:
    """Return how fast Gazebo is behind our protocol, by the clock, since it is a process of its own."""
    what = "Gazebo 11: wheels, ground and contact"
    instance = trials(cars)[0]
    starts = tuple(Pose(2.0 * (n % 8), 2.0 * (n // 8), 1.0, 0.0) for n in range(cars))
    try:
        took = _stepped(replace(instance, starts=starts), circling((1, cars)))
    except DubinsTrafficError as error:
        return Rate(what, cars, None, str(error))
    return Rate(what, cars, cars * STEPPED / took)


def _stepped(instance: Instance, commands: Floats) -> float:
    """Return the seconds by the clock of the best round of Gazebo's; the first one warms up."""
    simulator = Gazebo()
    try:
        simulator.reset([instance])
        took: list[float] = []
        for _ in range(ROUNDS + 1):
            began = perf_counter()
            for _ in range(STEPPED):
                simulator.step(commands.copy())
            took.append(perf_counter() - began)
    finally:
        simulator.close()
    return min(took[1:])
