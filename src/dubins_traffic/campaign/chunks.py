"""Cuts the trials of a campaign into chunks, the units of work."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from dubins_traffic.campaign.settings import Scalar
from dubins_traffic.controllers.registry import COMPILED
from dubins_traffic.problem.configuration import Configuration

if TYPE_CHECKING:
    from pathlib import Path

    from dubins_traffic.runs.jobs import Job

MOST_CAR_STEPS = 3_000_000
"""Car-steps of the largest chunks, about half a second: as much work is lost with a worker."""
LEAST_CAR_STEPS = 500_000
"""Car-steps of the smallest chunks, about a tenth of a second: ten times the cost of sending and storing a chunk."""
SHARES = 16
"""A chunk is 1 / SHARES of the remaining work, within these bounds, so that all workers end at about the same time."""
MOST_IN_CHUNK = 2_000
TRIAL = 1_000
"""Cost of beginning and scoring a trial, in car-steps."""
ASKED = 200
"""Least cost of asking a controller in Python once, in car-steps."""
KEPT_S = 1.0
"""Seconds that a controller in Python may take for a chunk: what is finished is kept that often, or trial by trial."""


@dataclass(frozen=True, slots=True)
class Cell:
    """One combination of a configuration and a value of each factor.

    `values` has the factors as in tables. `first` is the number of the cell's first trial in the campaign; each
    controller has `count` trials. The instance of trial k, for every controller, is ``draw(settled, seed, k)``, where
    `settled` is the configuration with the values put in.
    """

    index: int
    configuration: str
    values: Mapping[str, Scalar]
    seed: int
    first: int
    count: int
    settled: Configuration


@dataclass(frozen=True, slots=True)
class Chunk:
    """A unit of work: `count` trials, from number `trial`, of one controller in one cell.

    Attributes
    ----------
    number : int
        Number of the first of them in the campaign; the others follow.
    configuration : Configuration
        What the instances are drawn from, with `seed` and the number of the trial.
    controller : str
        The controller, as `controllers.registry.load` takes it.
    deadline : float or None
        Seconds within which each `act` must answer.
    metrics : tuple of str
        Further metrics.
    """

    number: int
    configuration: Configuration
    seed: int
    controller: str
    trial: int
    count: int
    deadline: float | None = None
    metrics: tuple[str, ...] = ()

    @property
    def end(self) -> int:
        """The number after the last."""
        return self.number + self.count

    def job(self, k: int, record: Path | None = None) -> Job:
        """Return the job that runs trial k of the chunk, from 0, by itself."""
        from dubins_traffic.runs.jobs import Job  # which needs all that runs trials

        return Job(
            self.trial + k, self.seed, self.controller, configuration=self.configuration, record=record,
            overwrite=True, deadline=self.deadline, metrics=self.metrics,
        )  # fmt: skip

    def part(self, number: int, end: int) -> Chunk:
        """Return the chunk of the trials from `number` up to before `end`."""
        trial = self.trial + number - self.number
        return replace(self, number=number, trial=trial, count=end - number)


def cut(
    cells: Sequence[Cell],
    places: Sequence[str],
    most: int | None = None,
    deadline: float | None = None,
    metrics: tuple[str, ...] = (),
) -> Iterator[Chunk]:
    """Return the chunks of a campaign, in the order of its trials.

    Parameters
    ----------
    cells : sequence of Cell
        Its cells.
    places : sequence of str
        Its controllers.
    most : int, optional
        Trials in a chunk; by default by how long they take, and fewer towards the end.
    deadline : float, optional
        Seconds within which each `act` must answer.
    metrics : tuple of str
        Further metrics.
    """
    left = sum(cell.count * cost(cell, place) for cell in cells for place in places)
    for cell in cells:
        for k, place in enumerate(places):
            each = cost(cell, place)
            trial = 0
            while trial < cell.count:
                rest = cell.count - trial
                pieces = -(-rest // (most or _trials(left, each)))
                count = min(most, rest) if most else -(-rest // pieces)
                number = cell.first + k * cell.count + trial
                yield Chunk(number, cell.settled, cell.seed, place, trial, count, deadline, metrics)
                trial += count
                left -= count * each


class Pace:
    """Cuts chunks to what their controllers, of which nobody knows how long they think, do in about `KEPT_S`.

    The first trials of a controller in Python are chunks of their own.
    """

    def __init__(self) -> None:
        self._answer_s: dict[str, float] = {COMPILED: 0.0}

    def pieces(self, chunks: Iterable[Chunk]) -> Iterator[Chunk]:
        """Yield the trials of `chunks`, in order, in chunks that are no larger."""
        for chunk in chunks:
            number = chunk.number
            while number < chunk.end:
                end = min(chunk.end, number + self._trials(chunk))
                yield chunk.part(number, end)
                number = end

    def note(self, chunk: Chunk, answer_s: float | None) -> None:
        """Note how long the controller of a chunk took for an answer, seconds; None, of nobody asked, tells nothing."""
        if answer_s is not None:
            self._answer_s[chunk.controller] = answer_s

    def _trials(self, chunk: Chunk) -> int:
        return fitting(self._answer_s.get(chunk.controller), ticks(chunk.configuration), chunk.count)


def fitting(answer_s: float | None, ticks: float, count: int) -> int:
    """Return how many of `count` trials are run before what is finished is kept, about every `KEPT_S`.

    It is one while nobody knows how long their controller takes for an answer, `answer_s` seconds in each of `ticks`.
    """
    if answer_s is None:
        return 1
    each_s = answer_s * ticks
    return max(1, int(KEPT_S / each_s)) if each_s * count > KEPT_S else count


def ticks(settled: Configuration) -> float:
    """Return the ticks of the longest trial of a configuration."""
    settings = settled.settings
    seconds = settings.duration_bounds[1] if settings.duration is None else settings.duration
    return seconds * settings.rate


def cost(cell: Cell, controller: str) -> float:
    """Return an estimate of the cost of a trial, in car-steps of the compiled tick."""
    python_cost = 0 if controller == COMPILED else ASKED
    return TRIAL + ticks(cell.settled) * (1 + len(cell.settled.agents) + python_cost)


def _trials(left: float, each: float) -> int:
    """Return the largest number of trials of the next chunk, given the cost `left` and the cost of `each` trial."""
    steps = min(MOST_CAR_STEPS, max(LEAST_CAR_STEPS, left / SHARES))
    return max(1, min(MOST_IN_CHUNK, int(steps / each)))
