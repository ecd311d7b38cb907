"""Compiles all kernels beforehand, by running a moment of each kind of trial."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from time import sleep
from typing import Any

from dubins_traffic.checkup.scenarios import scenarios
from dubins_traffic.controllers import registry as controllers
from dubins_traffic.engine.batch import outcomes
from dubins_traffic.errors import InputError
from dubins_traffic.kernels import asking
from dubins_traffic.kernels.compile import TIER, never_compiled, rehearsal
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw, draw_many
from dubins_traffic.problem.instance import Disturbances, Instance, Laser
from dubins_traffic.record import reader
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.score import score
from dubins_traffic.verification.contacts import from_poses

SECONDS = 0.2
"""Simulated seconds of a rehearsal."""
PAUSE = 0.1
"""Seconds between two checks of what has been compiled."""
MANY = 3
"""Number of trials in a rehearsal of trials that are drawn and run together."""
DRIVERS = ("simple", "lanes", "rules")
Progress = Callable[[int, int], object]


def precompile(*, everything: bool = False, progress: Progress | None = None) -> list[str]:
    """Compile the kernels that trials need and are not in the cache yet, and wait for them.

    Parameters
    ----------
    everything : bool
        Also what is seldom needed: lasers, disturbances, formulas, checks of records, and games.
    progress : callable, optional
        Told how many kernels are compiled, and how many there are in all, each time.

    Returns
    -------
    list of str
        What could not be compiled, and why.

    Raises
    ------
    InputError
        If kernels are never compiled here.
    KeyboardInterrupt
        On Ctrl-C; what is compiled by then is kept, and nothing new begins.
    """
    if never_compiled():
        raise InputError("kernels are never compiled", file=TIER, value="interpreted", expected="auto")
    try:
        with rehearsal():
            for rehearse in _rehearsals(everything=everything):
                rehearse()
        _wait(progress)
    except BaseException:
        for wish in asking.wanted:
            wish.withdraw()
        raise
    return [f"{wish.wish.name}: {wish.failure.splitlines()[-1]}" for wish in asking.wanted if wish.failure]


def _wait(progress: Progress | None) -> None:
    done, whole = -1, len(asking.wanted)
    while done < whole:
        now = sum(wish.is_there() or bool(wish.failure) or wish.wish.path.exists() for wish in asking.wanted)
        if now != done and progress is not None:
            progress(now, whole)
        done = now
        if done < whole:
            sleep(PAUSE)


def _rehearsals(*, everything: bool) -> Iterator[Callable[[], object]]:
    """Yield functions that run a moment of each kind of trial."""
    town, demo = (_brief(draw(load_config(name), 0, 0)) for name in ("town", "demo"))
    for driver in DRIVERS:
        yield partial(run_trial, demo, driver)
        yield partial(run_trial, town, driver)
        yield partial(run_trial, town, controllers.shielded(driver))
        yield partial(_together, [town, replace(town, trial=1)], driver)
    yield partial(list, draw_many(load_config("town"), 0, range(MANY)))
    if not everything:
        return
    problem = replace(town.problem, laser=Laser(), formulas={"far": "[] <>[0,1] !left_ego"})
    noise = Disturbances(position_noise=0.01, heading_noise=0.01, command_delay=1, command_loss=0.1)
    yield partial(run_trial, replace(town, problem=problem, disturbances=noise), "lanes")
    yield partial(_checked, town)
    for instance in scenarios().values():
        yield partial(run_trial, _brief(instance), "lanes")
    yield partial(_game, scenarios()["dead ends"])


def _brief(instance: Instance) -> Instance:
    return replace(instance, duration=SECONDS)


def _together(instances: Sequence[Instance], driver: str) -> list[Any]:
    return list(outcomes(instances, driver))


def _checked(instance: Instance) -> None:
    """Record a trial, and judge the record."""
    with TemporaryDirectory() as folder:
        record = Path(folder) / "trial.mcap"
        run_trial(instance, "rules", record=record)
        score(from_poses(reader.read(record)))


def _game(instance: Instance) -> None:
    """Solve a game, if the instance has one that can be solved."""
    with contextlib.suppress(InputError):
        run_trial(_brief(instance), "synthesized")
