"""One trial at a time: how many times faster than real time, with a controller in plain Python and a record."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

from benchmarks.table import Row
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.runs.single import run_trial

TURNS = 40


def measure() -> list[Row]:
    """Return the rows of this benchmark; the limit is the simulated time itself."""
    instance = draw(load_config("demo"), 1, 0)
    times: list[float] = []
    with TemporaryDirectory() as folder:
        record = Path(folder) / "trial.mcap"
        for _ in range(TURNS):
            began = perf_counter()
            run_trial(instance, "simple", record=record, overwrite=True)
            times.append(perf_counter() - began)
    factor = instance.duration / sorted(times)[len(times) // 2]
    cars = len(instance.starts)
    name = f"one trial of {instance.duration:g} s, {cars} cars, `simple` in Python, scored, recorded"
    return [Row(name, f"{factor:.0f} times real time (median of {TURNS})", ">= 1000", factor >= 1000)]
