"""Car-steps a second of several ways to take cars through ticks, side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from benchmarks.table import Row

BATCH = "our batch: drivers, rules, scores"
MOTION = "our motion and contact alone, many worlds"
WORLD = "our world, stepped from Python, observed"
OURS = {"batch": BATCH, "motion": MOTION, "world": WORLD}


@dataclass(frozen=True, slots=True)
class Rate:
    """How fast something is with so many cars in a world; None and why if that is not known.

    A car-step is one car's way through one tick of a thirtieth of a second.
    """

    what: str
    cars: int
    per_second: float | None
    why: str = ""


def rows(rates: Sequence[Rate]) -> list[Row]:
    """Return a row for each rate; what is not ours says how many times as fast ours are with as many cars."""
    found = {(rate.what, rate.cars): rate.per_second for rate in rates}
    return [Row(f"{rate.cars} cars, {rate.what}", _figure(rate, found), "", True) for rate in rates]


def _figure(rate: Rate, found: dict[tuple[str, int], float | None]) -> str:
    if rate.per_second is None:
        return f"not measured: {rate.why}"
    figure = f"{rate.per_second:.2e} car-steps/s"
    if rate.what in OURS.values():
        return figure
    times = [
        f"{name} {_short(ours / rate.per_second)}"
        for name, what in OURS.items()
        if (ours := found.get((what, rate.cars))) is not None
    ]
    return f"{figure}; ours in times: {', '.join(times)}" if times else figure


def _short(value: float) -> str:
    """Return two digits of a ratio, one of a small one, without an exponent."""
    return f"{float(f'{value:.2g}'):,.0f}" if value >= 10.0 else f"{value:.{2 if value >= 0.01 else 1}g}"
