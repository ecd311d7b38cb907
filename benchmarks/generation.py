"""What it takes to draw road networks, and instances on them, in one process."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from time import process_time

from benchmarks.batch import configuration
from benchmarks.table import Row
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.roads.generate import generate, thinned_grid

RANDOM = {"random": {"intersections": 20, "segments": 26}}

MOST = 4e-4
"""Seconds that the drawing of a usual network may take."""


def measure() -> list[Row]:
    """Return the rows of this benchmark: means over several seeds, the first of which warms up."""
    fixed, random = configuration(agents=7), configuration(agents=7) | {"network": RANDOM}
    grid, own = load_config(fixed), load_config(random)
    usual = [
        (f"random network, {n} intersections, {m} segments", 100, partial(generate, n, m))
        for n, m in ((12, 15), (20, 26))
    ]
    found: list[tuple[str, int, Callable[[int], object]]] = [
        ("random network, 100 intersections, 140 segments", 10, lambda k: generate(100, 140, k)),
        ("grid of 100 x 100 without a fifth", 3, lambda k: thinned_grid(Draws(k, 0, 0), 100, 100, 0.2)),
        ("instance of 8 cars on a grid of 4 x 5", 100, lambda k: draw(grid, 1, k)),
        ("instance of 8 cars on a random network of its own", 100, lambda k: draw(own, 1, k)),
    ]
    rows = [_row(*own, most=MOST) for own in usual]
    return rows + [_row(*own) for own in found]


def _row(name: str, count: int, work: Callable[[int], object], most: float = 0.0) -> Row:
    """Return the row of what is done for `count` seeds, with a bar where it may take `most` seconds at most."""
    work(0)
    began = process_time()
    for k in range(1, count + 1):
        work(k)
    seconds = (process_time() - began) / count
    bar = f"<= {1e3 * most:g} ms" if most else ""
    return Row(name, f"{1e3 * seconds:.2f} ms, {1.0 / seconds:,.0f}/s", bar, not most or seconds <= most)
