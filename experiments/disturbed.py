"""Do drivers keep the rules with commands that come late and poses that are noisy, and how many rounds does it cost?

    python -m experiments disturbed
    python -m experiments.disturbed [TRIALS]

Trials of the shipped configuration `town`, 120 s each, with 5 mm of noise on each axis of every pose that drivers see,
and with commands that take effect 0 to 3 ticks late: the ego's alone, and then all cars'.
"""

from __future__ import annotations

import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import product
from typing import Final, Literal

from benchmarks.table import Row, show
from tests.contract_provoking import PROVOKING
from tests.contract_scenes import Came, trial

from dubins_traffic.errors import InputError
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.parts import Disturbances
from dubins_traffic.runs.single import run_trial

TRIALS, SCENES = 200, 20
"""Trials of each kind, and variations of each scene."""
DURATION: Final = 120.0
NOISE: Final = 0.005
SEED: Final = 7
CONTROLLERS: Final = ("rules", "lanes+shield")
LEAST: Final = {0: 0.0, 1: 0.85, 2: 0.0, 3: 0.7}
"""Ticks of delay, and the least share of the rounds without."""
Cars = Literal["ego", "all"]


@dataclass(frozen=True, slots=True)
class Drive:
    """One trial: the controller, ticks of delay, the number, whose delay it is; what was broken by whom, and rounds."""

    controller: str
    delay: int
    number: int
    cars: Cars = "ego"
    broken: tuple[str, ...] = ()
    rounds: int = 0


def driven(asked: Drive) -> Drive:
    """Run the trial that `asked` names."""
    instance = draw(load_config("town"), SEED, asked.number)
    disturbed = Disturbances(command_delay=asked.delay, position_noise=NOISE, cars=asked.cars)
    instance = replace(instance, disturbances=disturbed, duration=DURATION)
    score = run_trial(instance, asked.controller, sketch=False).score
    assert score.verdict is not None
    broken = tuple(f"{one.rule} {one.car}" for one in score.verdict.violations)
    return replace(asked, broken=broken, rounds=score.rounds)


def provoked(scene: tuple[str, int, int]) -> Came | None:
    """Run a scene of the contract, by name, variation and ticks of delay of all cars; None if that is refused."""
    name, number, delay = scene
    disturbed = Disturbances(command_delay=delay, position_noise=NOISE, cars="all")
    try:
        return trial(name, number, DURATION + 10.0, disturbed)
    except InputError:
        return None


def drives(trials: int = TRIALS, jobs: int = 2) -> list[Drive]:
    """Run so many trials of each controller, delay and kind, in `jobs` processes."""
    kinds: tuple[Cars, ...] = ("ego", "all")
    asked = [Drive(name, delay, n, cars) for name, cars, delay, n in product(CONTROLLERS, kinds, LEAST, range(trials))]
    with ProcessPoolExecutor(jobs) as pool:
        return list(pool.map(driven, asked, chunksize=4))


def scenes(variations: int = SCENES, jobs: int = 2) -> list[tuple[int, Came | None]]:
    """Run so many variations of each scene with each delay; return the delays with what came of it."""
    asked = [(name, n, delay) for name in PROVOKING for n in range(variations) for delay in LEAST]
    with ProcessPoolExecutor(jobs) as pool:
        return list(zip([delay for _, _, delay in asked], pool.map(provoked, asked, chunksize=4), strict=True))


def bars(every: list[Drive], staged: list[tuple[int, Came | None]]) -> list[Row]:
    """Return the table."""
    rows: list[Row] = []
    whose = {"ego": "the ego", "all": "all cars"}
    for name, cars in product(CONTROLLERS, whose):
        usual = sum(one.rounds for one in every if (one.controller, one.delay, one.cars) == (name, 0, "ego"))
        for delay, least in LEAST.items():
            own = [one for one in every if (one.controller, one.delay, one.cars) == (name, delay, cars)]
            broken, share = sum(bool(one.broken) for one in own), sum(one.rounds for one in own) / usual
            says = f"`{name}`, {whose[cars]} {delay} ticks late: trials of {len(own)} in which a rule is broken"
            rows.append(Row(says, str(broken), "0", not broken))
            bar = f">= {least:g}" if least else ""
            rows.append(Row("rounds, of those without delay", f"{share:.2f}", bar, share >= least))
    for delay in LEAST:
        came = [one for own, one in staged if own == delay]
        fit = [one for one in came if one is not None and one.admitted and not one.own]
        broken = sum(bool(one.others) for one in fit)
        says = f"scenes, all cars {delay} ticks late: trials of {len(fit)} in which a lawful car breaks a rule"
        refused = f" ({sum(one is None for one in came)} refused)"
        rows.append(Row(says, f"{broken}{refused}", "0", not broken))
    return rows


def measure() -> list[Row]:
    """Run all trials and return the table of the bars."""
    return bars(drives(), scenes())


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else TRIALS
    show("late commands and noisy poses", bars(drives(count), scenes(-(-count // 10))))
