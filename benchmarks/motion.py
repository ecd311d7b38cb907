"""Move, contact and on-road of a batch, against a bare kernel that does the least that could be called moving.

The bare kernel carries headings along exact arcs, as we do, and looks at all pairs at the end pose only: no bounds on
commands, no contact within the tick, nothing fixed, no roads. Its arrays have the layout that suits it best.
"""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter

import numpy as np

from benchmarks.table import Row
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.trig import advance
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.roads.lookup import on_road
from dubins_traffic.roads.packing import pack
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.simulators.embedded import Embedded

TRIALS, CARS, TICKS, ROUNDS = 4096, 8, 30, 12
CHUNK = 256


@jit
def bare(x: Floats, y: Floats, c: Floats, s: Floats, u: Floats, w: Floats, dt: float, reach: float, hits: Ints) -> None:
    """Move every car along its arc, then count the pairs of each trial that overlap at the end.

    Arrays are (cars, trials), so that one instruction works on many trials; CHUNK trials at a time stay in the
    nearest memory.
    """
    cars, trials = x.shape
    limit = reach * reach
    for begin in range(0, trials, CHUNK):
        end = min(trials, begin + CHUNK)
        for n in range(cars):
            xn, yn, cn, sn = x[n, begin:end], y[n, begin:end], c[n, begin:end], s[n, begin:end]
            un, wn = u[n, begin:end], w[n, begin:end]
            for b in range(end - begin):
                xn[b], yn[b], cn[b], sn[b] = advance(xn[b], yn[b], cn[b], sn[b], un[b], wn[b], dt)
        near = hits[begin:end]
        for i in range(cars - 1):
            for j in range(i + 1, cars):
                xi, yi, xj, yj = x[i, begin:end], y[i, begin:end], x[j, begin:end], y[j, begin:end]
                for b in range(end - begin):
                    dx = xi[b] - xj[b]
                    dy = yi[b] - yj[b]
                    near[b] += 1 if dx * dx + dy * dy < limit else 0


@jit
def all_on_road(roads: RoadTable, x: Floats, y: Floats, on: Ints) -> None:
    """Tell of every car whether it is on the road."""
    trials, cars = x.shape
    for b in range(trials):
        for n in range(cars):
            on[b, n] = 1 if on_road(roads, 0, x[b, n], y[b, n]) else 0


def measure() -> list[Row]:
    """Return the rows of this benchmark; both kernels take turns, and the best turn of each counts."""
    config = load_config("benchmarks/traffic.json")
    instances = [draw(config, 1, trial) for trial in range(64)] * (TRIALS // 64)
    rng = np.random.default_rng(1)
    commands = rng.uniform([-0.7, -3.0], [0.7, 3.0], (TICKS, TRIALS, CARS, 2))
    simulator = Embedded()
    state = simulator.reset(instances)
    roads = pack([instances[0].problem.network], [0.6])
    on = np.zeros((TRIALS, CARS), dtype=np.int64)
    hits = np.zeros(TRIALS, dtype=np.int64)
    copy = [np.ascontiguousarray(column.T) for column in state[:4]]
    held = [[np.ascontiguousarray(command[:, :, k].T) for k in range(2)] for command in commands]
    touched = 0

    def ours() -> None:
        nonlocal touched
        for command in commands:
            touched += sum(map(len, simulator.step(command)))
            all_on_road(roads, state.x, state.y, on)

    def least() -> None:
        for speed, yaw in held:
            bare(*copy, speed, yaw, 1 / 30, 0.354, hits)

    ours()
    least()
    limit, own = _turns(least, ours)
    steps = TRIALS * CARS * TICKS
    name = f"move + contact + on-road, {TRIALS} trials x {CARS} cars"
    return [
        Row(
            "bare kernel: arcs, all pairs at the end pose",
            f"{steps / limit:.2e} car-steps/s",
            "> 1.5e8",
            steps / limit > 1.5e8,
        ),
        Row(name, f"{steps / own:.2e} car-steps/s = {limit / own:.2f} of it", ">= 0.25", limit / own >= 0.25),
    ]


def _turns(one: Callable[[], None], other: Callable[[], None]) -> tuple[float, float]:
    best = [float("inf"), float("inf")]
    for _ in range(ROUNDS):
        for k, work in enumerate((one, other)):
            began = perf_counter()
            work()
            best[k] = min(best[k], perf_counter() - began)
    return best[0], best[1]
