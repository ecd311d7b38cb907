"""What it takes to draw road networks, and instances on them, in one process."""

from __future__ import annotations

from collections.abc import Callable
from time import process_time

from benchmarks.batch import configuration
from benchmarks.table import Row
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.roads.generate import generate, thinned_grid

RANDOM = {"random": {"intersections": 20, "segments": 26}}


def measure() -> list[Row]:
    """Return the rows of this benchmark: means over several seeds, the first of which warms up."""
    fixed, random = configuration(agents=7), configuration(agents=7) | {"network": RANDOM}
    grid, own = load_config(fixed), load_config(random)
    found = [
        ("random network, 20 intersections, 26 segments", 100, lambda k: generate(20, 26, k)),
        ("random network, 100 intersections, 140 segments", 10, lambda k: generate(100, 140, k)),
        ("grid of 100 x 100 without a fifth", 3, lambda k: thinned_grid(Draws(k, 0, 0), 100, 100, 0.2)),
        ("instance of 8 cars on a grid of 4 x 5", 100, lambda k: draw(grid, 1, k)),
        ("instance of 8 cars on a random network of its own", 100, lambda k: draw(own, 1, k)),
    ]
    return [Row(name, _figure(count, work), "", True) for name, count, work in found]


def _figure(count: int, work: Callable[[int], object]) -> str:
    work(0)
    began = process_time()
    for k in range(1, count + 1):
        work(k)
    seconds = (process_time() - began) / count
    return f"{1e3 * seconds:.2f} ms, {1.0 / seconds:,.0f}/s"
