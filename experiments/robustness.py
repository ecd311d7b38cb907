"""How many trials stay clean with commands that come late or get lost, and noisy poses: the table of the pages.

    python -m experiments robustness
    python -m experiments.robustness [TRIALS]

The trials are those of `dubins-traffic check-controller C --robustness`: the shipped configuration `town`, a minute
each, with 0 to 3 ticks of delay, 0 to 20 mm of noise on each axis of every pose that is seen, and 0 to 10 % of the
commands lost; of the ego alone, and of all cars, in which nobody may break a rule.
"""

from __future__ import annotations

import sys
from itertools import product
from typing import Final, Literal, NamedTuple

from benchmarks.table import Row, show

from dubins_traffic.checkup.robustness import DELAYS, LOSSES, NOISES, robustness
from dubins_traffic.errors import InputError

TRIALS: Final = 5


class Who(NamedTuple):
    """A controller, and whose commands are late or lost, and who sees noisy poses."""

    controller: str
    cars: Literal["ego", "all"]


EVERY: Final = (Who("rules", "ego"), Who("lanes+shield", "ego"), Who("rules", "all"))


def rows(who: Who, trials: int) -> list[Row]:
    """Return a row for each delay and loss: in how many trials nobody breaks a rule, noise by noise."""
    says = "`lawful` cars and `rules`" if who.cars == "all" else f"`{who.controller}`"
    columns = {noise: _column(who, noise, trials) for noise in NOISES}
    return [
        Row(
            f"{says}, {delay} ticks late, {loss:.0%} lost: trials of {trials} in which nobody breaks a rule, with "
            f"{', '.join(f'{1000 * noise:g}' for noise in NOISES)} mm of noise",
            ", ".join(column.get((delay, loss), "refused") for column in columns.values()),
            "",
            True,
        )
        for loss in LOSSES
        for delay in DELAYS
    ]


def _column(who: Who, noise: float, trials: int) -> dict[tuple[int, float], str]:
    """Return what came of the trials with so much noise (m), by delay and loss; nothing of those that are refused."""
    found: dict[tuple[int, float], str] = {}
    for delay, loss in product(DELAYS, LOSSES):
        try:
            (cell,) = robustness(
                who.controller, trials=trials, workers=2, delays=[delay], noises=[noise], losses=[loss],
                cars=who.cars,
            ).cells  # fmt: skip
        except InputError as refused:
            print(f"{who}, {delay} ticks, {1000 * noise:g} mm, {loss:.0%} lost: {refused}", file=sys.stderr)
            continue
        found[delay, loss] = str(min(cell.clean, cell.trials - cell.others_broke))
    return found


def measure(trials: int = TRIALS) -> list[Row]:
    """Return the table."""
    return [row for who in EVERY for row in rows(who, trials)]


if __name__ == "__main__":
    show("robustness", measure(int(sys.argv[1]) if len(sys.argv) > 1 else TRIALS))
