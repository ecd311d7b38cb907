"""Do drivers keep the rules with commands that come late and poses that are noisy, and how many rounds does it cost?

    python -m experiments disturbed
    python -m experiments.disturbed [TRIALS] [JOBS]

Trials of the shipped configuration `town`, 120 s each, with 5 mm of noise on each axis of every pose that the ego's
driver sees, and with commands that take effect 0 to 3 ticks late.
"""

from __future__ import annotations

import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from typing import Final

from benchmarks.table import Row, show

from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.parts import Disturbances
from dubins_traffic.runs.single import run_trial

TRIALS: Final = 200
DURATION: Final = 120.0
NOISE: Final = 0.005
SEED: Final = 7
CONTROLLERS: Final = ("rules", "lanes+shield")
LEAST: Final = {0: 0.0, 1: 0.85, 2: 0.0, 3: 0.7}
"""Ticks of delay, and the least share of the rounds without."""


@dataclass(frozen=True, slots=True)
class Drive:
    """One trial: the controller, ticks of delay, the number; the rules that the ego broke, and its rounds."""

    controller: str
    delay: int
    number: int
    broken: tuple[str, ...] = ()
    rounds: int = 0


def driven(asked: Drive) -> Drive:
    """Run the trial that `asked` names."""
    instance = draw(load_config("town"), SEED, asked.number)
    disturbed = Disturbances(command_delay=asked.delay, position_noise=NOISE)
    instance = replace(instance, disturbances=disturbed, duration=DURATION)
    score = run_trial(instance, asked.controller, sketch=False).score
    assert score.verdict is not None
    broken = tuple(one.rule for one in score.verdict.violations if one.car == "ego")
    return replace(asked, broken=broken, rounds=score.rounds)


def drives(trials: int = TRIALS, jobs: int = 2) -> list[Drive]:
    """Run so many trials of each controller and delay, in `jobs` processes."""
    asked = [Drive(name, delay, n) for name in CONTROLLERS for delay in LEAST for n in range(trials)]
    with ProcessPoolExecutor(jobs) as pool:
        return list(pool.map(driven, asked, chunksize=4))


def bars(every: list[Drive]) -> list[Row]:
    """Return the table."""
    rows: list[Row] = []
    for name in CONTROLLERS:
        usual = sum(one.rounds for one in every if one.controller == name and one.delay == 0)
        for delay, least in LEAST.items():
            own = [one for one in every if one.controller == name and one.delay == delay]
            broken, share = sum(bool(one.broken) for one in own), sum(one.rounds for one in own) / usual
            says = f"`{name}`, {delay} ticks late: trials of {len(own)} in which it breaks a rule"
            rows.append(Row(says, str(broken), "0", not broken))
            bar = f">= {least:g}" if least else ""
            rows.append(Row("rounds, of those without delay", f"{share:.2f}", bar, share >= least))
    return rows


def measure() -> list[Row]:
    """Run all trials and return the table of the bars."""
    return bars(drives())


if __name__ == "__main__":
    show("late commands and noisy poses", bars(drives(*(int(argument) for argument in sys.argv[1:3]))))
