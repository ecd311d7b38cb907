"""How a controller drives with commands that come late or get lost, and with noisy poses: a table of short trials."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import Any, Literal

from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.parts import Disturbances
from dubins_traffic.runs.jobs import Job, run_trials
from dubins_traffic.scoring.score import Score

CONFIGURATION, SEED, SECONDS = "town", 1, 60.0
DELAYS = (0, 1, 2, 3)
"""Ticks by which commands come late."""
NOISES = (0.0, 0.005, 0.01, 0.02)
"""Standard deviations of the poses that are seen, along each axis, metres."""
LOSSES = (0.0, 0.05, 0.1)
"""Shares of the commands that get lost."""


@dataclass(frozen=True, slots=True)
class Cell:
    """What came of the trials with a delay (ticks), noise (m) and loss (share of the commands).

    Of `trials`, how many were `clean`, in how many an e-agent broke a rule, and their counted rounds in all.
    """

    delay: int
    noise: float
    loss: float
    trials: int
    clean: int
    others_broke: int
    counted_rounds: int


@dataclass(frozen=True, slots=True)
class Robustness:
    """A controller's table: a cell for each delay, noise and loss."""

    controller: str
    cells: tuple[Cell, ...]

    def to_json(self) -> dict[str, Any]:
        """Return the table as a JSON object."""
        return {"controller": self.controller, "cells": [asdict(cell) for cell in self.cells]}

    def cell(self, delay: int, noise: float, loss: float) -> Cell:
        """Return one cell."""
        return next(cell for cell in self.cells if (cell.delay, cell.noise, cell.loss) == (delay, noise, loss))


def robustness(
    controller: str,
    *,
    trials: int = 3,
    workers: int = 1,
    delays: Sequence[int] = DELAYS,
    noises: Sequence[float] = NOISES,
    losses: Sequence[float] = LOSSES,
    cars: Literal["ego", "all"] = "ego",
    progress: Callable[[int, int], object] | None = None,
) -> Robustness:
    """Let a controller drive the same trials of `town` with each delay, noise and loss.

    Parameters
    ----------
    controller : str
        As for `run_trial`.
    trials : int
        Of each cell; trial k is the same instance in every cell, but for the disturbances.
    workers : int
        Processes that share the trials.
    delays, noises, losses : sequences
        In ticks, metres and shares.
    cars : str
        Whose commands come late or get lost, and who sees noisy poses: the ego, or all cars.
    progress : callable, optional
        Is told after each trial how many have ended, of how many.

    Raises
    ------
    InputError
        If there is no such controller.
    """
    configuration = load_config(CONFIGURATION)
    kinds = [
        Disturbances(command_delay=delay, position_noise=noise, command_loss=loss, cars=cars)
        for loss, delay, noise in product(losses, delays, noises)
    ]
    whole = [replace(draw(configuration, SEED, trial), duration=SECONDS) for trial in range(trials)]
    jobs = [
        Job(trial, SEED, controller, instance=replace(instance, disturbances=kind))
        for kind in kinds
        for trial, instance in enumerate(whole)
    ]
    scores: dict[Disturbances, list[Score]] = {kind: [] for kind in kinds}
    for count, result in enumerate(run_trials(jobs, workers), 1):
        scores[result.instance.disturbances].append(result.score)
        if progress is not None:
            progress(count, len(jobs))
    return Robustness(controller, tuple(_cell(kind, score) for kind, score in scores.items()))


def _cell(kind: Disturbances, scores: Sequence[Score]) -> Cell:
    verdicts = [score.verdict for score in scores if score.verdict is not None]
    clean = sum(verdict.clean for verdict in verdicts)
    others = sum(verdict.assumption_broken for verdict in verdicts)
    rounds = sum(score.counted_rounds for score in scores)
    return Cell(kind.command_delay, kind.position_noise, kind.command_loss, len(scores), clean, others, rounds)
